#!/usr/bin/env python3
"""Controller and grid in CoFmuPy. It sets and reads nothing but Reals: export both with --portable."""

import importlib.metadata
import json
import pathlib
import tempfile

from case1 import EVENTS, MEASUREMENTS, OBSERVED, SETPOINTS, STEP, STEPS, Journal, fmus, portable, variables

folder = fmus()
files = {"controller": folder / "BessConsensusPortable.fmu", "grid": folder / "BessGridPortable.fmu"}


def connection(source, target, name):
    name = portable(name)
    return {
        "source": {"type": "fmu", "id": source, "variable": name},
        "target": {"type": "fmu", "id": target, "variable": name},
    }


def schedule(fmu, name, values):
    source = {"type": "literal", "values": values, "interpolation": "previous"}
    return {"source": source, "target": {"type": "fmu", "id": fmu, "variable": portable(name)}}


def start_values(file):
    """CoFmuPy starts every input at 0 unless told otherwise, and topology 0 is none."""
    inputs = {name: start for name, (_, _, causality, start) in variables(file).items() if causality == "input"}
    return {name: float(start) for name, start in inputs.items()}


configuration = {
    "root": "",
    "cosim_method": "jacobi",
    "iterative": False,
    "fmus": [
        {"id": name, "name": name, "path": str(file), "initialization": start_values(file)}
        for name, file in files.items()
    ],
    "connections": [connection("grid", "controller", name) for name in MEASUREMENTS]
    + [connection("controller", "grid", name) for name in SETPOINTS]
    + [schedule(fmu, name, {"0": 0, str(at): float(value)}) for at, fmu, name, value in EVENTS],
}

with tempfile.TemporaryDirectory() as scratch:
    file = pathlib.Path(scratch) / "case1.json"
    file.write_text(json.dumps(configuration))
    # Its server half needs more than a simulation does; the coordinator stands alone.
    from cofmupy.coordinator import Coordinator

    coordinator = Coordinator()
    coordinator.start(str(file))
    journal = Journal()
    for _ in range(STEPS):
        coordinator.do_step(STEP)
        # get_results() holds all outputs of all steps; inputs are seen one by one.
        values = {fmu: [coordinator.get_variable((fmu, portable(name)))[0] for name in OBSERVED[fmu]] for fmu in files}
        journal.add(**values)

journal.report("CoFmuPy", importlib.metadata.version("cofmupy"))
