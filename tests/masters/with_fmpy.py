#!/usr/bin/env python3
"""Controller and grid in a loop of FMPy: read all, write all, step all (Jacobi)."""

import fmpy
from case1 import MEASUREMENTS, OBSERVED, SETPOINTS, STEP, STEPS, Journal, events_at, fmus
from slave import Slave

folder = fmus()
slaves = {
    "controller": Slave(folder / "BessConsensus.fmu", "controller"),
    "grid": Slave(folder / "BessGrid.fmu", "grid"),
}
controller, grid = slaves["controller"], slaves["grid"]

journal = Journal()
for k in range(STEPS):
    for fmu, name, value in events_at(k):
        slaves[fmu].set([name], [value])
    measured, commanded = grid.get(MEASUREMENTS), controller.get(SETPOINTS)
    controller.set(MEASUREMENTS, measured)
    grid.set(SETPOINTS, commanded)
    controller.step(k, STEP)
    grid.step(k, STEP)
    journal.add(controller.get(OBSERVED["controller"]), grid.get(OBSERVED["grid"]))

journal.report("FMPy", fmpy.__version__)
for slave in slaves.values():
    slave.close()
