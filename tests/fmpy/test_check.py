"""`bess check` on our FMUs, clean and broken in every way that it knows; its verdicts beside those of FMPy."""

import json
import re
import subprocess
import sys
import zipfile

import pytest
from fmpy.validation import validate_fmu

XML = "modelDescription.xml"
LIBRARY = "binaries/linux64/BessConsensus.so"
GLIBC_AND_PLATFORMS = {"glibc", "platforms", "name-plain", "input-not-real"}


def check(bess, file, *options):
    """Exit code and findings."""
    done = subprocess.run([bess, "check", "--json", *options, file], capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stderr
    return done.returncode, json.loads(done.stdout)


def entries_of(file):
    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def pack(entries, file, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in entries.items():
            # writestr would turn the backslash of a mutation into a slash.
            information = zipfile.ZipInfo("x")
            information.filename = information.orig_filename = name
            information.compress_type = method
            archive.writestr(information, data)
    return file


# --- what can be wrong -----------------------------------------------------------------------------------

def xml(pattern, replacement, count=1):
    """A mutation of the description; the pattern must be there."""

    def mutate(entries):
        text = entries[XML].decode()
        changed, times = re.subn(pattern, replacement, text, count=count, flags=re.DOTALL)
        assert times, pattern
        entries[XML] = changed.encode()

    return mutate


def rename(old, new):
    def mutate(entries):
        entries[new] = entries.pop(old)

    return mutate


def patch(name, old, new):
    """Bytes of a file replaced by as many others."""

    def mutate(entries):
        assert len(old) == len(new) and old in entries[name]
        entries[name] = entries[name].replace(old, new)

    return mutate


def put(name, data):
    def mutate(entries):
        entries[name] = data

    return mutate


def drop(start):
    def mutate(entries):
        names = [name for name in entries if name.startswith(start)]
        assert names, start
        for name in names:
            del entries[name]

    return mutate


def variable(name, change):
    """A mutation within one ScalarVariable: `change` maps its text to another."""

    def mutate(entries):
        text = entries[XML].decode()
        start = text.index(f'<ScalarVariable name="{name}"')
        end = text.index("</ScalarVariable>", start) + len("</ScalarVariable>")
        changed = change(text[start:end])
        assert changed != text[start:end], name
        entries[XML] = (text[:start] + changed + text[end:]).encode()

    return mutate


def swap(a, b):
    return lambda text: text.replace(a, b)


def move_units(entries):
    text = entries[XML].decode()
    block = re.search(r"  <UnitDefinitions>.*?</UnitDefinitions>\n", text, re.DOTALL)[0]
    text = text.replace(block, "").replace("  <ModelVariables>", block + "  <ModelVariables>")
    entries[XML] = text.encode()


def add_variable(body, attributes):
    """One more variable at the end, so that no index moves."""
    element = f'<ScalarVariable name="extra" valueReference="99999" {attributes}>{body}</ScalarVariable>'
    return xml("  </ModelVariables>", f"    {element}\n  </ModelVariables>")


UNKNOWN = r'      <Unknown index="\d+" dependencies="[^"]*"/>\n'

# Name: (mutation, rule that must be found, does FMPy refuse it: True, False, or None where it has no opinion).
MUTATIONS = {
    "malformed": (xml("</fmiModelDescription>", ""), "xml-malformed", True),
    "doctype": (xml(r"\?>\n", '?>\n<!DOCTYPE x [<!ENTITY a "b">]>\n'), "xml-malformed", None),
    "not utf-8": (lambda e: e.update({XML: e[XML].replace(b"Measured", b"Me\xffsured", 1)}), "xml-malformed", True),
    "units after the experiment": (move_units, "schema-order", True),
    "unknown element": (xml("  <LogCategories>", "  <Remarks/>\n  <LogCategories>"), "schema-element", True),
    "unknown attribute": (xml('modelName="', 'modelColour="red" modelName="'), "schema-attribute", True),
    "the flag spelt as in English": (xml("canRunAsynchronuously", "canRunAsynchronously"), "schema-attribute", True),
    "no model name": (xml(' modelName="[^"]*"', ""), "schema-missing-attribute", True),
    "no value reference": (xml(' valueReference="1"', ""), "schema-missing-attribute", True),
    "no structure": (xml("  <ModelStructure>.*</ModelStructure>\n", ""), "schema-missing-element", True),
    "a start that is no number": (variable("P[1]", swap('start="0.0"', 'start="nought"')), "schema-value", True),
    "a start as Rust writes it": (variable("P[1]", swap('start="0.0"', 'start="inf"')), "schema-value", True),
    "a causality of its own": (variable("P[1]", swap('"input"', '"inputs"')), "schema-value", True),
    "an index below nought": (xml('<Unknown index="[0-9]+"', '<Unknown index="-1"'), "schema-value", True),
    "FMI 2.1": (xml('fmiVersion="2.0"', 'fmiVersion="2.1"'), "fmi-version", True),
    "no implementation": (xml("  <CoSimulation.*?/>\n", ""), "no-implementation", None),
    "braces": (xml('guid="([^"]*)"', r'guid="{\1}"'), "guid-braces", False),
    "identifier with a dash": (xml('modelIdentifier="BessConsensus"', 'modelIdentifier="Bess-Consensus"'), "model-identifier", None),
    "needs a tool": (xml('needsExecutionTool="false"', 'needsExecutionTool="true"'), "execution-tool", False),
    "serialises what it cannot get": (xml('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"'), "serialize-without-state", None),
    "stop before start": (xml('startTime="0.0"', 'startTime="1e9"'), "default-experiment-range", None),
    "no experiment": (xml("  <DefaultExperiment[^>]*>\n", ""), "default-experiment", False),
    "a name twice": (xml('name="P\\[2\\]"', 'name="P[1]"'), "name-unique", True),
    "a name with a space": (xml('name="P\\[2\\]"', 'name="P 2"'), "name-structured", True),
    "a gap in an array": (xml('name="P\\[7\\]"', 'name="P[9]"'), "array-gap", False),
    "one reference for two inputs": (variable("P[2]", swap('valueReference="2"', 'valueReference="1"')), "reference-alias", None),
    "a fixed input": (variable("P[1]", swap('"continuous"', '"fixed"')), "causality-variability", True),
    "a continuous parameter": (variable("K_P[1]", swap('variability="fixed"', 'variability="continuous"')), "causality-variability", True),
    "a calculated parameter by initial": (variable("K_P[1]", swap('initial="exact"', 'initial="calculated"')), "initial", True),
    "an input with initial": (variable("P[1]", swap('causality="input"', 'causality="input" initial="approx"')), "initial-of-input", True),
    "a continuous Boolean": (variable("enable", swap('"discrete"', '"continuous"')), "continuous-not-real", True),
    "an input without start": (variable("P[1]", swap(' start="0.0"', "")), "start-missing", True),
    "a parameter without start": (variable("K_P[1]", lambda t: re.sub(' start="[^"]*"', "", t)), "start-missing", True),
    "an output with start": (variable("spread_P", swap("<Real ", '<Real start="1" ')), "start-forbidden", True),
    "a start below its minimum": (variable("eta", lambda t: re.sub('start="[^"]*"', 'min="1" start="0.5"', re.sub(' m(in|ax)="[^"]*"', "", t))), "start-range", None),
    "a range with nothing in it": (variable("eta", lambda t: re.sub("start=", 'min="1" max="0" start=', re.sub(' m(in|ax)="[^"]*"', "", t))), "range-empty", None),
    "time as a variable": (add_variable("<Real/>", 'causality="independent" variability="continuous"'), "independent", False),
    "a text in the interface": (add_variable('<String start="x"/>', 'causality="parameter" variability="fixed"'), "string-in-interface", False),
    "a derivative of nothing": (add_variable('<Real derivative="99999"/>', ""), "derivative", None),
    "a unit that is not defined": (variable("P[1]", swap('unit="pu"', 'unit="MW"')), "unit-undefined", True),
    "a display unit that is not defined": (variable("P[1]", swap('unit="pu"', 'unit="pu" displayUnit="MW"')), "display-unit-undefined", True),
    "a unit twice": (xml('(    <Unit name="pu">.*?</Unit>\n)', r"\1\1"), "unit-twice", None),
    "a unit without base": (xml('<Unit name="pu">.*?</Unit>', '<Unit name="pu"/>'), "unit-without-base", False),
    "a type that is not declared": (variable("P[1]", swap("<Real ", '<Real declaredType="Power" ')), "declared-type", True),
    "an output left out": (xml("<Outputs>\n" + UNKNOWN, "<Outputs>\n"), "structure-outputs", True),
    "an initial unknown left out": (xml("<InitialUnknowns>\n" + UNKNOWN, "<InitialUnknowns>\n"), "structure-initial-unknowns", True),
    "an input among the outputs": (xml("<Outputs>\n", '<Outputs>\n      <Unknown index="1" dependencies=""/>\n'), "structure-outputs", True),
    "an index outside": (xml('(<Outputs>\n      <Unknown index=)"[0-9]+"', r'\1"99999"'), "structure-index", True),
    "entries not ascending": (xml(f"(<Outputs>\n)({UNKNOWN})({UNKNOWN})", r"\1\3\2"), "structure-order", False),
    "dependencies left out": (xml('(<Unknown index="[0-9]+") dependencies=""', r"\1"), "structure-dependencies", False),
    "dependencies outside": (xml('dependencies=""', 'dependencies="99999"'), "structure-dependency", None),
    "dependencies descending": (xml('dependencies=""', 'dependencies="2 1"'), "structure-order", False),
    "more kinds than dependencies": (xml('dependencies=""', 'dependencies="1" dependenciesKind="fixed fixed"'), "structure-dependencies-kind", True),
    "kinds without dependencies": (xml('dependencies=""', 'dependenciesKind="dependent"'), "structure-dependencies-kind", True),
    "one folder too deep": (lambda e: [rename(name, f"model/{name}")(e) for name in list(e)], "archive-description", True),
    "a backslash": (rename("resources/controller.json", "resources\\controller.json"), "archive-backslash", True),
    "a path out of the archive": (put("../evil.txt", b"x"), "archive", None),
    "a stray file": (put("README.txt", b"x"), "archive-stray", False),
    "no documentation": (drop("documentation/index.html"), "documentation", False),
    "no library": (drop("binaries/"), "no-binary", None),
    "a library of another name": (rename(LIBRARY, "binaries/linux64/Consensus.so"), "binary-name", None),
    "a library that is none": (put(LIBRARY, b"MZ nothing of the kind"), "binary-format", None),
    "a library of another platform": (lambda e: put("binaries/win64/BessConsensus.dll", e[LIBRARY])(e), "binary-format", None),
    "a platform of its own": (put("binaries/amiga/BessConsensus.so", b"x"), "platform-unknown", None),
    "a function missing": (patch(LIBRARY, b"\0fmi2CancelStep\0", b"\0fmi2CancelStop\0"), "functions", None),
    "a symbol of its own": (patch(LIBRARY, b"\0fmi2CancelStep\0", b"\0mine_CancelSte\0"), "foreign-symbols", None),
    "a library that nobody has": (patch(LIBRARY, b"\0libm.so.6\0", b"\0libz.so.6\0"), "needed-library", None),
}


@pytest.fixture(params=MUTATIONS)
def mutation(request):
    return MUTATIONS[request.param]


@pytest.fixture
def broken(mutation, archives, tmp_path):
    entries = entries_of(archives["controller"])
    mutation[0](entries)
    return pack(entries, tmp_path / "broken.fmu")


def test_our_fmus_are_clean_and_run(bess, archives):
    for file in archives.values():
        code, report = check(bess, file)
        assert code == 0 and report["ran"]
        assert (report["errors"], report["warnings"]) == (0, 0), report["findings"]
        assert {finding["rule"] for finding in report["findings"]} <= GLIBC_AND_PLATFORMS
        assert "nothing went wrong" in report["facts"]["short run"]


def test_each_mutation_gives_its_finding(bess, mutation, broken, archives):
    _, rule, _ = mutation
    _, before = check(bess, archives["controller"], "--no-run")
    code, report = check(bess, broken, "--no-run")
    found = [finding for finding in report["findings"] if finding["rule"] == rule]
    assert found, [finding["rule"] for finding in report["findings"]]
    assert rule not in {finding["rule"] for finding in before["findings"]}
    for finding in found:
        assert all(finding[key] for key in ("file", "found", "expected", "mend", "severity")), finding
    errors = [finding for finding in report["findings"] if finding["severity"] == "error"]
    assert code == (1 if errors else 0) and report["errors"] == len(errors)


def test_lines_and_variables_are_named(bess, archives, tmp_path):
    entries = entries_of(archives["controller"])
    variable("Q[3]", swap('unit="pu"', 'unit="MVAr"'))(entries)
    line = 1 + entries[XML][: entries[XML].index(b'name="Q[3]"')].count(b"\n")
    _, report = check(bess, pack(entries, tmp_path / "broken.fmu"), "--no-run")
    (finding,) = [finding for finding in report["findings"] if finding["rule"] == "unit-undefined"]
    assert (finding["file"], finding["line"], finding["variable"]) == (XML, line, "Q[3]")
    assert "MVAr" in finding["found"] and "pu" in finding["expected"] and "FMPy" in finding["refused_by"]


WITH_OPINION = [name for name, (_, _, refuses) in MUTATIONS.items() if refuses is not None]


@pytest.mark.parametrize("mutation", WITH_OPINION, indirect=True)
def test_fmpy_agrees_where_it_has_an_opinion(bess, mutation, broken):
    _, rule, refuses = mutation
    problems = validate_fmu(str(broken))
    assert bool(problems) == refuses, problems
    _, report = check(bess, broken, "--no-run")
    named = [f for f in report["findings"] if f["rule"] == rule]
    claims = any(tool.startswith(("FMPy", "every importer")) for finding in named for tool in finding["refused_by"])
    # What the finding says of FMPy is what FMPy does.
    if refuses or rule not in ("execution-tool",):
        assert claims == refuses, (named[0]["refused_by"], problems)
    if refuses:
        assert report["errors"] > 0


def test_an_unusual_compression_is_refused(bess, archives, tmp_path):
    broken = pack(entries_of(archives["controller"]), tmp_path / "broken.fmu", zipfile.ZIP_BZIP2)
    code, report = check(bess, broken, "--no-run")
    assert code == 1 and {"archive", "archive-method"} & {f["rule"] for f in report["findings"]}


def test_strict_minds_warnings(bess, archives, tmp_path):
    entries = entries_of(archives["controller"])
    MUTATIONS["braces"][0](entries)
    broken = pack(entries, tmp_path / "broken.fmu")
    assert check(bess, broken, "--no-run")[0] == 0
    assert check(bess, broken, "--no-run", "--strict")[0] == 1


def test_no_run_executes_nothing(bess, archives, tmp_path):
    """A description that the library refuses is found by the run only."""
    entries = entries_of(archives["controller"])
    xml('guid="[^"]*"', 'guid="another"')(entries)
    broken = pack(entries, tmp_path / "broken.fmu")
    assert check(bess, broken, "--no-run")[0] == 0
    code, report = check(bess, broken)
    assert code == 1
    (finding,) = [finding for finding in report["findings"] if finding["severity"] == "error"]
    assert finding["rule"] == "run-call" and "fmi2Instantiate" in finding["found"]


SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Demo(Fmi2Slave):
    def __init__(self, **given):
        super().__init__(**given)
        self.u = self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, time, step):
        self.y += step * self.u
        return True
"""


def test_an_fmu_of_pythonfmu_shows_what_is_known_of_that_tool(bess, tmp_path):
    """It needs Python, lists no InitialUnknowns, exports C++ by the hundred; FMPy minds the second."""
    (tmp_path / "demo.py").write_text(SLAVE)
    builder = [sys.executable, "-m", "pythonfmu", "build", "-f", "demo.py"]
    subprocess.run(builder, cwd=tmp_path, check=True, capture_output=True)
    code, report = check(bess, tmp_path / "Demo.fmu", "--no-run")
    found = {finding["rule"] for finding in report["findings"]}
    expected = {"structure-initial-unknowns", "execution-tool", "structure-dependencies", "foreign-symbols", "needed-library"}
    assert code == 1 and expected <= found
    platforms = {f["file"] for f in report["findings"] if f["rule"] == "foreign-symbols"}
    assert {"binaries/linux64/Demo.so", "binaries/win64/Demo.dll"} <= platforms
    (problem,) = validate_fmu(str(tmp_path / "Demo.fmu"))
    assert "InitialUnknowns" in problem
    # All that FMPy minds, and nothing that it lets pass, is an error here.
    assert {f["rule"] for f in report["findings"] if f["severity"] == "error"} == {"structure-initial-unknowns"}
