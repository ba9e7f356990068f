#!/usr/bin/env python3
"""Controller and grid in a loop of FMPy: read all, write all, step all (Jacobi)."""

import collections

import fmpy
from case1 import MEASUREMENTS, OBSERVED, SETPOINTS, STEP, STEPS, Journal, command_line, events_at
from slave import Slave

parser = command_line()
parser.add_argument("--late", type=int, default=0, help="steps that measurements are held back [default: 0]")
options = parser.parse_args()
slaves = {
    "controller": Slave(options.fmus / "BessConsensus.fmu", "controller"),
    "grid": Slave(options.fmus / "BessGrid.fmu", "grid"),
}
controller, grid = slaves["controller"], slaves["grid"]

# On the way to the controller; a loop of one's own needs no such queue.
on_the_way = collections.deque([grid.get(MEASUREMENTS)] * options.late)
journal = Journal()
for k in range(STEPS):
    for fmu, name, value in events_at(k):
        slaves[fmu].set([name], [value])
    on_the_way.append(grid.get(MEASUREMENTS))
    commanded = controller.get(SETPOINTS)
    controller.set(MEASUREMENTS, on_the_way.popleft())
    grid.set(SETPOINTS, commanded)
    controller.step(k, STEP)
    grid.step(k, STEP)
    journal.add(controller.get(OBSERVED["controller"]), grid.get(OBSERVED["grid"]))

journal.report(f"FMPy, late by {options.late}" if options.late else "FMPy", fmpy.__version__)
for slave in slaves.values():
    slave.close()
