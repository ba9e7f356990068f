"""The packed FMUs, unpacked once, and instances of them that are closed after each test."""

import os
import pathlib
import sys

import fmpy
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).parent))

from fmus import Fmu  # noqa: E402

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
