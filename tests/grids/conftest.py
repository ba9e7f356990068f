"""The controller FMU, unpacked, and pandapower's case57 made into an FMU once."""

import os
import pathlib
import sys

import fmpy
import pytest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
# An FMU in FMPy is the same here and there.
sys.path[:0] = [str(HERE), str(ROOT / "tests/fmpy")]


@pytest.fixture(scope="session")
def controller_fmu(tmp_path_factory):
    """The folder of Case 1's controller: seven batteries, droops of Table I."""
    file = ROOT / "fmu/BessConsensus.fmu"
    if not file.is_file():
        pytest.exit("fmu/BessConsensus.fmu is missing: run `cargo xtask fmu` first", returncode=1)
    return fmpy.extract(file, tmp_path_factory.mktemp("controller"))


@pytest.fixture(scope="session")
def bess():
    """The `bess` command, built in release."""
    file = pathlib.Path(os.environ.get("BESS_RELEASE_DIR", ROOT / "target/release")) / "bess"
    assert file.is_file(), f"{file} is missing: run `cargo xtask fmu` first"
    return file


@pytest.fixture(scope="session")
def pandapower_fmu(tmp_path_factory):
    """pandapower_slave.py as Case57.fmu, made by PythonFMU."""
    from pythonfmu.builder import FmuBuilder

    folder = tmp_path_factory.mktemp("pandapower")
    return FmuBuilder.build_FMU(HERE / "pandapower_slave.py", dest=folder)
