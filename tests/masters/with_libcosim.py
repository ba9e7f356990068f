#!/usr/bin/env python3
"""Controller and grid in libcosim (the Open Simulation Platform), through libcosimpy."""

import importlib.metadata

from case1 import MEASUREMENTS, OBSERVED, SETPOINTS, STEP, STEPS, Journal, events_at, fmus, variables
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

log_output_level(CosimLogLevel.WARNING)
folder = fmus()
files = {"controller": folder / "BessConsensus.fmu", "grid": folder / "BessGrid.fmu"}
execution = CosimExecution.from_step_size(step_size=STEP * 1e9)
index = {name: execution.add_local_slave(CosimLocalSlave(str(file), name)) for name, file in files.items()}
known = {name: variables(file) for name, file in files.items()}


def reference(fmu, name):
    return known[fmu][name][0]


for source, target, names in [("grid", "controller", MEASUREMENTS), ("controller", "grid", SETPOINTS)]:
    for name in names:
        execution.connect_real_variables(
            index[source], reference(source, name), index[target], reference(target, name)
        )

observer = CosimObserver.create_last_value()
execution.add_observer(observer)
manipulator = CosimManipulator.create_override()
execution.add_manipulator(manipulator)


def override(fmu, name, value):
    """An input keeps the overriding value until it is reset."""
    number, kind, _, _ = known[fmu][name]
    setters = {
        "Real": manipulator.slave_real_values,
        "Integer": manipulator.slave_integer_values,
        "Boolean": manipulator.slave_boolean_values,
    }
    assert setters[kind](index[fmu], [number], [value])


def observed(fmu):
    return list(observer.last_real_values(index[fmu], [reference(fmu, name) for name in OBSERVED[fmu]]))


journal = Journal()
for k in range(STEPS):
    for event in events_at(k):
        override(*event)
    assert execution.step()
    journal.add(observed("controller"), observed("grid"))

journal.report("libcosim", importlib.metadata.version("libcosimpy"))
