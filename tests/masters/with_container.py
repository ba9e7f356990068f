#!/usr/bin/env python3
"""Controller and grid packed into one FMU by the FMU Manipulation Toolbox, which then runs as one, here in FMPy."""

import importlib.metadata
import json
import pathlib
import shutil
import subprocess
import sysconfig
import tempfile

from case1 import INPUTS, OBSERVED, STEP, STEPS, Journal, events_at, fmus
from slave import Slave

FILES = {"controller": "BessConsensus.fmu", "grid": "BessGrid.fmu"}
# The inputs of the controller are inside the container; nobody sees them.
SEEN = {fmu: [name for name in names if fmu == "grid" or name not in INPUTS] for fmu, names in OBSERVED.items()}


def tool(name, *arguments):
    """Runs one of the toolbox's commands; what it prints comes back."""
    command = [pathlib.Path(sysconfig.get_path("scripts")) / name, *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def check(file):
    """`fmutool -check` ends with an error where it finds one; a warning counts here as well."""
    said = tool("fmutool", "-input", str(file), "-check")
    assert "compliant with FMI-2.0" in said and "No semantic error" in said, said
    assert "ERROR" not in said and "WARNING" not in said, said


def pack(folder, scratch):
    """Equal names are linked; inputs that nobody feeds become inputs of the container."""
    description = {
        "name": "BessSystem.fmu",
        "fmu": list(FILES.values()),
        "step_size": STEP,
        "auto_link": True,
        "auto_input": True,
        "auto_output": False,
        "output": [[FILES[fmu], name, f"{fmu}.{name}"] for fmu in FILES for name in SEEN[fmu]],
    }
    file = scratch / "container.json"
    file.write_text(json.dumps(description))
    # The container is written into the folder of its FMUs.
    for name in FILES.values():
        shutil.copy(folder / name, scratch)
    tool("fmucontainer", "-fmu-directory", str(scratch), "-container", str(file))
    return scratch / "BessSystem.fmu"


with tempfile.TemporaryDirectory() as scratch:
    folder = fmus()
    for name in FILES.values():
        check(folder / name)
    system = Slave(pack(folder, pathlib.Path(scratch)), "system")

    journal = Journal()
    for k in range(STEPS):
        for _, name, value in events_at(k):
            system.set([name], [value])
        system.step(k, STEP)
        controller, grid = (system.get([f"{fmu}.{name}" for name in SEEN[fmu]]) for fmu in FILES)
        journal.add(controller + [None] * len(INPUTS), grid)
    journal.report("fmu-manipulation-toolbox", importlib.metadata.version("fmu-manipulation-toolbox"))
    system.close()
