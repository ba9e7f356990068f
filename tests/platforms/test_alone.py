"""One executable is enough: `bess` alone in an empty folder exports for every platform."""

import json
import shutil
import subprocess
import zipfile

import pytest
from conftest import MODELS, PLATFORMS, library


@pytest.fixture
def alone(bess, tmp_path):
    """`alone("export", ...)`: runs a copy of `bess` beside which there is nothing, with an empty PATH."""
    program = tmp_path / "program" / "bess"
    program.parent.mkdir()
    shutil.copy(bess, program)
    folder = tmp_path / "work"
    folder.mkdir()

    def run(*arguments):
        return subprocess.run(
            [program, *arguments], cwd=folder, env={"PATH": ""}, capture_output=True, text=True, check=True
        )

    run.folder = folder
    return run


@pytest.mark.parametrize("which", MODELS)
def test_bess_alone_exports_for_every_platform(alone, unpacked, which):
    scenario = json.loads(alone("show", "case1").stdout)
    scenario["control"]["eta"] = 0.7
    (alone.folder / "mine.json").write_text(json.dumps(scenario))
    written = alone("export", which, "mine.json", "-o", "Mine.fmu")
    assert all(platform in written.stderr for platform in PLATFORMS)
    assert not written.stdout
    with zipfile.ZipFile(alone.folder / "Mine.fmu") as archive:
        assert archive.testzip() is None
        for platform, suffix in PLATFORMS.items():
            packed = archive.read(f"binaries/{platform}/{MODELS[which]}{suffix}")
            assert packed == library(unpacked, which, platform).read_bytes()
        resources = [name for name in archive.namelist() if name.startswith("resources/")]
        assert any(archive.read(name) for name in resources)
    again = alone.folder / "Again.fmu"
    alone("export", which, "mine.json", "-o", again.name)
    assert again.read_bytes() == (alone.folder / "Mine.fmu").read_bytes()


def test_bess_says_what_it_carries(alone):
    sentence = "carries the shared libraries for linux64, win64, aarch64-linux."
    assert sentence in " ".join(alone("--version").stdout.split())
    assert sentence in " ".join(alone("export", "--help").stdout.split())
