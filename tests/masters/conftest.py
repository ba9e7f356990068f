"""The files that the masters get, where Case 1 comes to rest in our own harness, and the table at the end."""

import os
import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = ROOT / "tests/masters"
RESULTS = []


@pytest.fixture(scope="session")
def bess():
    """`bess(arguments...)` runs the built command and returns what it prints."""
    program = pathlib.Path(os.environ.get("BESS_RELEASE_DIR", ROOT / "target/release")) / "bess"
    assert program.is_file(), f"{program} is missing: run `cargo xtask fmu` first"

    def run(*arguments):
        done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture(scope="session")
def fmus(bess, tmp_path_factory):
    """A folder with both FMUs in both interfaces, and the system."""
    folder = tmp_path_factory.mktemp("fmus")
    for part, name in [("controller", "BessConsensus"), ("grid", "BessGrid")]:
        bess("export", part, HERE / "case1_short.json", "-o", folder / f"{name}.fmu")
        bess("export", part, HERE / "case1_short.json", "--portable", "-o", folder / f"{name}Portable.fmu")
    bess("export", "system", HERE / "case1_from_start.json", "-o", folder / "BessSystem.ssp")
    return folder


@pytest.fixture(scope="session")
def rest(bess, tmp_path_factory):
    """{"grid.omega[1]": value, ...} at the end of Case 1 shortened, from `bess run`."""
    folder = tmp_path_factory.mktemp("harness")
    bess("run", HERE / "case1_short.json", "--no-report", "--quiet", "-o", folder)
    with open(folder / "trajectory.csv") as file:
        header, *_, last = file
    return dict(zip(header.strip().split(","), map(float, last.split(","))))


@pytest.fixture(scope="session")
def python():
    """`python(script)`: the interpreter that has what the script imports. CoFmuPy wants an FMPy of its own."""
    cofmupy = os.environ.get("BESS_COFMUPY_PYTHON", ROOT / "target/venv/masters-cofmupy/bin/python")
    return lambda script: cofmupy if "cofmupy" in script else sys.executable


@pytest.fixture
def record():
    """`record(row)` puts a row into the table."""
    return RESULTS.append


def pytest_terminal_summary(terminalreporter):
    if not RESULTS:
        return
    heads = ("master", "version", "delay, steps", "steps/s", "worst difference, pu", "verdict")
    rows = [heads, *RESULTS]
    widths = [max(len(row[i]) for row in rows) for i in range(len(heads))]
    terminalreporter.section("Case 1 shortened, against the harness")
    for row in rows:
        terminalreporter.write_line("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())
