"""What each shared library asks of the system that loads it, and what it shows, read by binutils."""

import re
import subprocess

import pytest
from conftest import MODELS, PLATFORMS, library

# The files of the C library itself. Until glibc 2.34 threads and dlsym were files of their own.
GLIBC = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2"}
LOADERS = {"linux64": {"ld-linux-x86-64.so.2"}, "aarch64-linux": {"ld-linux-aarch64.so.1"}}
OLDEST_GLIBC = (2, 17)

# What every Windows from 8 on has in its own folder; no runtime library of a compiler is among them.
WINDOWS = {"kernel32", "ntdll", "msvcrt", "userenv", "ws2_32", "bcryptprimitives", "api-ms-win-core-synch-l1-2-0"}

ELF = [platform for platform, suffix in PLATFORMS.items() if suffix == ".so"]
BOTH = pytest.mark.parametrize("which", MODELS)


def said(*command):
    return subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True).stdout


def test_both_fmus_are_for_every_platform(unpacked):
    for which, model in MODELS.items():
        files = {path.relative_to(unpacked[which]).as_posix() for path in unpacked[which].glob("binaries/*/*")}
        assert files == {f"binaries/{platform}/{model}{suffix}" for platform, suffix in PLATFORMS.items()}


@BOTH
@pytest.mark.parametrize("platform", ELF)
def test_linux_libraries_need_nothing_but_an_old_glibc(unpacked, which, platform):
    file = library(unpacked, which, platform)
    needed = set(re.findall(r"NEEDED.*\[(.*)\]", said("readelf", "--wide", "--dynamic", file)))
    assert "libc.so.6" in needed
    assert needed <= GLIBC | LOADERS[platform], needed
    versions = re.findall(r"GLIBC_(\d+)\.(\d+)", said("readelf", "--wide", "--version-info", file))
    assert versions
    newest = max((int(major), int(minor)) for major, minor in versions)
    assert newest <= OLDEST_GLIBC, f"{platform} {which} needs GLIBC_{newest[0]}.{newest[1]}"


@BOTH
def test_the_windows_library_needs_only_what_windows_has(unpacked, which):
    listed = said("x86_64-w64-mingw32-objdump", "--private-headers", library(unpacked, which, "win64"))
    needed = {name.lower().removesuffix(".dll") for name in re.findall(r"DLL Name: (.*)", listed)}
    assert "kernel32" in needed
    assert needed <= WINDOWS, needed


@BOTH
@pytest.mark.parametrize("platform", PLATFORMS)
def test_the_functions_of_both_standards_are_shown_and_nothing_else(unpacked, which, platform, root):
    file = library(unpacked, which, platform)
    if platform in ELF:
        table = said("readelf", "--wide", "--dyn-syms", file).splitlines()
        rows = [line.split() for line in table if re.match(r"\s*\d+: ", line)]
        shown = {row[7] for row in rows if len(row) > 7 and row[6] != "UND"}
    else:
        listed = said("x86_64-w64-mingw32-objdump", "--private-headers", file)
        # From binutils 2.41 on an ordinal stands between the number and the name.
        shown = set(re.findall(r"^\s*\[ *\d+\](?: \+base\[ *\d+\] +[0-9a-f]+)? (\S+)$", listed, re.MULTILINE))
    assert shown == functions(root)


def functions(root):
    """The functions that the standards' headers declare: of FMI 2.0 those for co-simulation, of FMI 3.0 all."""
    header = (root / "src/fmi/headers/fmi2Functions.h").read_text()
    declared = set(re.findall(r"FMI2_Export \w+\s+(fmi2\w+)", header))
    names = declared - {name for name in declared if name in MODEL_EXCHANGE}
    assert len(names) == 34, sorted(names)
    header = (root / "src/fmi/headers/fmi3Functions.h").read_text()
    three = set(re.findall(r"^FMI3_Export \w+\s+(fmi3\w+);", header, re.MULTILINE))
    assert len(three) == 75, sorted(three)
    return names | three


MODEL_EXCHANGE = {
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
    "fmi2CompletedIntegratorStep",
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
    "fmi2GetContinuousStates",
    "fmi2GetNominalsOfContinuousStates",
}
