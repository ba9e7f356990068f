"""The wheel, installed into an environment of its own that has nothing else, not even pip."""

import os
import pathlib
import subprocess
import sys
import venv

import pytest


@pytest.fixture(scope="session")
def wheel():
    """The built wheel."""
    return pathlib.Path(os.environ["BESS_WHEEL"])


@pytest.fixture(scope="session")
def environment(wheel, tmp_path_factory):
    """The folder of programs of an environment that holds the wheel alone."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False)
    # This environment's pip works on that one; no index, so that nothing but the wheel can come in.
    pip = [sys.executable, "-m", "pip", "--python", folder / "bin/python", "install", "--no-index", "--quiet"]
    subprocess.run([*pip, "--disable-pip-version-check", wheel], check=True)
    return folder / "bin"


@pytest.fixture(scope="session")
def bess(environment, tmp_path_factory):
    """`bess(...)`: runs the installed command in an empty folder, found by its name alone."""
    folder = tmp_path_factory.mktemp("work")

    def run(*arguments):
        command = ["env", "-i", f"PATH={environment}", "bess", *map(str, arguments)]
        # env itself is not in that PATH.
        return subprocess.run(["/usr/bin/" + command[0], *command[1:]], cwd=folder, capture_output=True, text=True)

    run.folder = folder
    return run
