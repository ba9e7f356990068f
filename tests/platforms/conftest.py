"""The packed FMUs, unpacked once, and the driver for each platform with the means to run it."""

import os
import pathlib
import shutil
import subprocess
import sys
import zipfile

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).parent))

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).parent
PLATFORMS = {"linux64": ".so", "win64": ".dll", "aarch64-linux": ".so"}
MODELS = {"controller": "BessConsensus", "grid": "BessGrid"}


@pytest.fixture(scope="session")
def root():
    """The workspace root."""
    return ROOT


@pytest.fixture(scope="session")
def built():
    """Where `cargo xtask` leaves what it builds for other platforms."""
    return pathlib.Path(os.environ.get("BESS_PLATFORMS_DIR", ROOT / "target/platforms"))


@pytest.fixture(scope="session")
def bess():
    """The `bess` that carries the libraries."""
    return pathlib.Path(os.environ.get("BESS_RELEASE_DIR", ROOT / "target/release")) / "bess"


@pytest.fixture(scope="session")
def unpacked(tmp_path_factory):
    """The folders of the two unpacked FMUs."""
    folders = {}
    for name, model in MODELS.items():
        folders[name] = tmp_path_factory.mktemp(model)
        zipfile.ZipFile(ROOT / f"fmu/{model}.fmu").extractall(folders[name])
    return folders


def library(unpacked, which, platform):
    """The shared library in an unpacked FMU."""
    return unpacked[which] / "binaries" / platform / (MODELS[which] + PLATFORMS[platform])


@pytest.fixture(scope="session")
def drivers(built, tmp_path_factory):
    """`drivers(platform, *arguments)`: runs the driver there and gives back what it printed."""
    folder = tmp_path_factory.mktemp("driver")
    made = {}

    def run(platform, *arguments):
        if platform not in made:
            made[platform] = DRIVERS[platform](folder, built)
        command, environment = made[platform]
        result = subprocess.run(
            [*command, *map(str, arguments)], capture_output=True, text=True, timeout=300, env=os.environ | environment
        )
        assert result.returncode == 0, f"{platform}: exit code {result.returncode}\n{result.stderr}"
        return result.stdout

    return run


def compile_c(compiler, sources, output, *options):
    command = [*compiler, "-O1", "-I", ROOT / "src/fmi/headers", *sources, "-o", output, *options]
    subprocess.run(list(map(str, command)), check=True)
    return output


def linux64(folder, _):
    return [compile_c(["cc"], [HERE / "driver.c"], folder / "driver", "-ldl")], {}


def aarch64_linux(folder, _):
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", "aarch64-linux-gnu.2.17"]
    driver = compile_c(zig, [HERE / "driver.c"], folder / "driver-aarch64", "-ldl")
    return ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu", driver], {}


def win64(folder, built):
    mingw = ["x86_64-w64-mingw32-gcc", "-static"]
    driver = compile_c(mingw, [HERE / "driver.c"], folder / "driver.exe")
    compile_c(mingw, [HERE / "bcryptprimitives.c"], folder / "bcryptprimitives.dll", "-shared", "-ladvapi32")
    wine = shutil.which("wine64") or "/usr/lib/wine/wine64"
    environment = {
        # Kept between runs: making it takes longer than all that is tested.
        "WINEPREFIX": str(built / "wine"),
        "WINEDEBUG": "-all",
        # No window that asks for Mono or a browser.
        "WINEDLLOVERRIDES": "mscoree=;mshtml=",
    }
    (built / "wine").mkdir(parents=True, exist_ok=True)
    return [wine, driver], environment


DRIVERS = {"linux64": linux64, "win64": win64, "aarch64-linux": aarch64_linux}
