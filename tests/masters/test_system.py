"""The .ssp and the portable FMUs as files: what the standards demand of them and what they say."""

import io
import pathlib
import zipfile

import fmpy.ssp
import pytest
from case1 import MEASUREMENTS, SETPOINTS, portable, variables
from fmpy.validation import validate_fmu
from lxml import etree

HERE = pathlib.Path(__file__).parent
SCHEMAS = pathlib.Path(fmpy.ssp.__file__).parent / "schema"
SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"


def documents(archive):
    """The descriptions in an .ssp, parsed."""
    with zipfile.ZipFile(archive) as file:
        names = [name for name in file.namelist() if name.endswith((".ssd", ".ssv"))]
        return {name: etree.parse(io.BytesIO(file.read(name))) for name in names}


def parameters(document):
    """{name: (type, value)} of a parameter set."""
    found = document.getroot().iter(f"{SSV}Parameter")
    return {p.get("name"): (etree.QName(p[0]).localname, p[0].get("value")) for p in found}


@pytest.fixture(params=[False, True], ids=["structured", "portable"])
def system(request, bess, tmp_path):
    """(whether portable, the descriptions)."""
    file = tmp_path / "BessSystem.ssp"
    bess("export", "system", HERE / "case1_from_start.json", "-o", file, *["--portable"] * request.param)
    return request.param, documents(file)


def test_the_documents_are_valid(system):
    _, found = system
    schemas = {
        "SystemStructure.ssd": "SystemStructureDescription.xsd",
        "resources/controller-scenario.ssv": "SystemStructureParameterValues.xsd",
        "resources/grid-scenario.ssv": "SystemStructureParameterValues.xsd",
    }
    assert set(found) == set(schemas)
    for name, document in found.items():
        schema = etree.XMLSchema(file=str(SCHEMAS / schemas[name]))
        assert schema.validate(document), f"{name}: {schema.error_log}"


def test_every_input_has_a_source_or_a_value(system, tmp_path):
    is_portable, found = system
    shown = portable if is_portable else str
    ssd = found["SystemStructure.ssd"].getroot()
    wires = {
        tuple(c.get(k) for k in ("startElement", "startConnector", "endElement", "endConnector"))
        for c in ssd.iter(f"{SSD}Connection")
    }
    expected = {("grid", shown(name), "controller", shown(name)) for name in MEASUREMENTS}
    expected |= {("controller", shown(name), "grid", shown(name)) for name in SETPOINTS}
    assert wires == expected

    fed = {(end, name) for _, _, end, name in wires}
    with zipfile.ZipFile(tmp_path / "BessSystem.ssp") as archive:
        for component, file in [("controller", "BessConsensus.fmu"), ("grid", "BessGrid.fmu")]:
            archive.extract(f"resources/{file}", tmp_path)
            values = parameters(found[f"resources/{component}-scenario.ssv"])
            for name, (_, kind, causality, start) in variables(tmp_path / "resources" / file).items():
                listed = name in values
                if causality == "output" or (component, name) in fed:
                    assert not listed, name
                elif kind == "Boolean" and not listed:
                    # FMPy would take it for true; the FMU starts with it anyway.
                    assert start in ("true", "false"), name
                else:
                    assert values[name][0] == kind, name


def test_the_scenarios_start_is_in_it(system):
    is_portable, found = system
    controller = parameters(found["resources/controller-scenario.ssv"])
    grid = parameters(found["resources/grid-scenario.ssv"])
    assert controller["enable"] == (("Real", "1.0") if is_portable else ("Boolean", "true"))
    assert grid[portable("dP_load[12]") if is_portable else "dP_load[12]"] == ("Real", "-0.5")
    assert controller["gain_E"] == ("Real", "0.0")


@pytest.mark.parametrize("name", ["BessConsensusPortable", "BessGridPortable"])
def test_a_portable_fmu_has_c_identifiers_and_reals_only(fmus, name):
    file = fmus / f"{name}.fmu"
    assert validate_fmu(str(file)) == []
    found, twin = variables(file), variables(fmus / f"{name.removesuffix('Portable')}.fmu")
    assert [portable(name) for name in twin] == list(found)
    for (number, kind, causality, _), (same_number, _, same_causality, _) in zip(found.values(), twin.values()):
        assert (number, kind, causality) == (same_number, "Real", same_causality)
    assert all(name.isidentifier() for name in found)


def test_the_excerpts_in_the_documentation_are_tested_code():
    """Each block of Python in docs/masters.md stands word for word in a script that runs here.

    Those about FMI 3.0 are run by tests/fmpy/test_three.py.
    """
    text = (HERE.parents[1] / "docs/masters.md").read_text().split("\n## FMI 3.0")[0]
    blocks = [block.split("```")[0] for block in text.split("```python\n")[1:]]
    scripts = {script.name: script.read_text() for script in HERE.glob("*with_*.py")}
    assert len(blocks) >= 9
    for block in blocks:
        assert any(block in script for script in scripts.values()), block
