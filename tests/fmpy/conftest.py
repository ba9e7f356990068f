"""The packed FMUs, unpacked once, and instances of them that are closed after each test."""

import os
import pathlib
import subprocess
import sys

import fmpy
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).parent))

from fmus import Fmu  # noqa: E402
from fmus3 import Fmu3  # noqa: E402

NAMES = {"controller": "BessConsensus", "grid": "BessGrid"}
ROOT = pathlib.Path(__file__).resolve().parents[2]


def packed(name):
    file = ROOT / "fmu" / f"{name}.fmu"
    if not file.is_file():
        pytest.exit(f"fmu/{name}.fmu is missing: run `cargo xtask fmu` first", returncode=1)
    return file


@pytest.fixture(scope="session")
def root():
    """The workspace root."""
    return ROOT


@pytest.fixture(scope="session")
def bess():
    """The `bess` command, built in release."""
    release = pathlib.Path(os.environ.get("BESS_RELEASE_DIR", ROOT / "target/release"))
    file = release / "bess"
    assert file.is_file(), f"{file} is missing: run `cargo xtask fmu` first"
    return file


@pytest.fixture(scope="session")
def reference():
    """The folder of the reference trajectories."""
    return ROOT.parent / "shared/reference"


@pytest.fixture(scope="session")
def archives():
    """The two .fmu files."""
    return {"controller": packed("BessConsensus"), "grid": packed("BessGrid")}


@pytest.fixture(scope="session")
def folders(archives, tmp_path_factory):
    """The two FMUs, unpacked."""
    made = {}
    for name, archive in archives.items():
        made[name] = tmp_path_factory.mktemp(name)
        fmpy.extract(archive, made[name])
    return made


@pytest.fixture
def make(folders):
    """`make("grid")`: a new instance, freed at the end of the test."""
    instances = []

    def instance(which, name=None, **options):
        instances.append(Fmu(folders[which], name or which, **options))
        return instances[-1]

    yield instance
    for one in instances:
        one.close()


@pytest.fixture
def controller(make):
    """A new controller."""
    return make("controller")


@pytest.fixture
def grid(make):
    """A new grid."""
    return make("grid")


@pytest.fixture(scope="session")
def three(bess, tmp_path_factory):
    """`three("controller")`: the archive for a scenario and more arguments of `bess export`."""
    folder, made = tmp_path_factory.mktemp("three"), {}

    def exported(which, scenario="case1", *more):
        key = (which, scenario, *more)
        if key not in made:
            made[key] = folder / f"{NAMES[which]}{len(made)}.fmu"
            command = [bess, "export", which, scenario, *more, "-o", made[key]]
            subprocess.run(command, check=True, capture_output=True)
        return made[key]

    return exported


@pytest.fixture(scope="session")
def unpacked(three, tmp_path_factory):
    """The folder of an unpacked FMU, of FMI 3.0 unless `version` says otherwise."""
    made = {}

    def folder(which, scenario="case1", version="3"):
        key = (which, scenario, version)
        if key not in made:
            made[key] = tmp_path_factory.mktemp(which)
            fmpy.extract(three(which, scenario, "--fmi", version), made[key])
        return made[key]

    return folder


@pytest.fixture
def make3(unpacked):
    """`make3("grid")`: a new FMI 3.0 instance, freed at the end of the test."""
    instances = []

    def instance(which, scenario="case1", **options):
        instances.append(Fmu3(unpacked(which, scenario), **options))
        return instances[-1]

    yield instance
    for one in instances:
        one.close()


@pytest.fixture
def make2(unpacked):
    """The same of FMI 2.0."""
    instances = []

    def instance(which, scenario="case1"):
        instances.append(Fmu(unpacked(which, scenario, "2"), which))
        return instances[-1]

    yield instance
    for one in instances:
        one.close()
