"""Case 1 shortened in other people's masters: the same steady state, however late each of them passes values on.

Each runs in a process of its own, so that one that crashes takes nobody along.
"""

import json
import pathlib
import subprocess

import pytest
from case1 import AGENTS, K_P, STEPS

HERE = pathlib.Path(__file__).parent
DOCUMENT = HERE.parents[1] / "docs/masters.md"

# What the steady states may differ by, pu. Left of the transients are 1e-12 in the harness.
TOLERANCE = 1e-6
# What the controller promises to cope with, steps.
LONGEST_DELAY = 3

# The name in the table and the script with its options.
MASTERS = {
    "FMPy": ["with_fmpy.py"],
    "FMPy, late by 1": ["with_fmpy.py", "--late", "1"],
    "FMPy, late by 2": ["with_fmpy.py", "--late", "2"],
    "libcosim": ["with_libcosim.py"],
    "Ecos": ["with_ecos.py"],
    "CoFmuPy": ["with_cofmupy.py"],
    "fmuloader": ["with_fmuloader.py"],
    "fmu-manipulation-toolbox": ["with_container.py"],
    "mosaik": ["with_mosaik.py"],
    "HELICS": ["with_helics.py"],
    "FMPy, .ssp": ["ssp_with_fmpy.py"],
    "libcosim, .ssp": ["ssp_with_libcosim.py"],
    "Ecos, .ssp": ["ssp_with_ecos.py"],
}


def simulated(command, seconds=300):
    """The line of JSON that a script ends with, or why there is none."""
    try:
        done = subprocess.run(command, cwd=HERE, capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return None, f"not done after {seconds} s"
    except OSError as error:
        return None, f"not started: {error}"
    lines = [line for line in done.stdout.splitlines() if line.startswith('{"master"')]
    if done.returncode == 0 and len(lines) == 1:
        return json.loads(lines[0]), ""
    said = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()] or ["nothing"]
    how = f"signal {-done.returncode}" if done.returncode < 0 else f"exit code {done.returncode}"
    return None, f"{how}: {said[-1].strip()[:120]}"


def problems(result, rest):
    """The worst difference from the harness, and everything that is not as it should be."""
    end = result["end"]
    names = [(q, i) for q in ("omega", "V", "P", "Q") for i in AGENTS]
    differences = {f"{q}[{i}]": abs(end[q][i - 1] - rest[f"grid.{q}[{i}]"]) for q, i in names}
    # A NaN is larger than everything, not smaller.
    worst = max(differences, key=lambda name: (differences[name] != differences[name], differences[name]))
    shares = [K * P for K, P in zip(K_P, end["P"])]
    checks = {
        f"{result['steps']} steps": STEPS <= result["steps"] <= STEPS + 1,
        f"{worst} is {differences[worst]:.1e} off": differences[worst] < TOLERANCE,
        "frequency is not restored": all(abs(omega - 1) < TOLERANCE for omega in end["omega"]),
        "power is not shared": max(shares) - min(shares) < TOLERANCE,
        f"delay {result['delay']}": result["delay"] is not None and 0 <= result["delay"] <= LONGEST_DELAY,
    }
    return differences[worst], [found for found, fine in checks.items() if not fine]


@pytest.mark.parametrize("name", MASTERS)
def test_the_same_steady_state(name, fmus, rest, python, record):
    script, *options = MASTERS[name]
    result, why = simulated([python(script), script, fmus, *options])
    if result is None:
        record((name, "", "", "", "", f"FAILED: {why}"))
        pytest.fail(f"{name}: {why}")
    worst, found = problems(result, rest)
    speed, delay = str(result["steps_per_second"]), str(result["delay"])
    verdict = "; ".join(["FAILED", *found]) if found else "same"
    record((name, result["version"], delay, speed, f"{worst:.1e}", verdict))
    assert not found, f"{name}: {verdict}"
    assert result["master"] == name
    row = f"| {name} | {result['version']} | {delay} |"
    assert row in DOCUMENT.read_text(), f"docs/masters.md does not say `{row}`"


def test_a_crash_and_a_wrong_end_are_seen(rest, tmp_path, python):
    """The test of the test: a master that dies, one that says nothing, and ends that are not those of Case 1."""
    script = tmp_path / "crash.py"
    for code, expected in [
        ("import os; os.abort()", "signal 6"),
        ("raise SystemExit('no such FMU')", "exit code 1: no such FMU"),
        ("pass", "exit code 0: nothing"),
        ("import time; time.sleep(60)", "not done after 2 s"),
    ]:
        script.write_text(code)
        result, why = simulated([python(""), script], seconds=2 if "sleep" in code else 60)
        assert result is None and why.startswith(expected), why
    result, why = simulated([tmp_path / "no-such-python", script])
    assert result is None and why.startswith("not started"), why

    end = {q: [rest[f"grid.{q}[{i}]"] for i in AGENTS] for q in ("omega", "V", "P", "Q")}
    good = {"steps": STEPS, "delay": 0, "end": end}
    assert problems(good, rest)[1] == []
    for quantity, value in [("omega", 1 + 2e-6), ("V", 1.02), ("P", float("nan")), ("Q", 0.0)]:
        assert problems({**good, "end": {**end, quantity: [value, *end[quantity][1:]]}}, rest)[1], quantity
    assert problems({**good, "steps": STEPS - 1}, rest)[1]
    assert problems({**good, "delay": None}, rest)[1]
    assert problems({**good, "delay": 4}, rest)[1]
