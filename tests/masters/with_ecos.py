#!/usr/bin/env python3
"""Controller and grid in Ecos, through ecospy (on Debian: apt-get install libtbb12)."""

import importlib.metadata

from case1 import MEASUREMENTS, OBSERVED, SETPOINTS, STEP, STEPS, Journal, events_at, fmus
from ecospy.EcosSimulation import EcosSimulation
from ecospy.EcosSimulationStructure import EcosSimulationStructure

folder = fmus()
with EcosSimulationStructure() as structure:
    structure.add_model("controller", str(folder / "BessConsensus.fmu"))
    structure.add_model("grid", str(folder / "BessGrid.fmu"))
    for name in MEASUREMENTS:
        structure.make_real_connection(f"grid::{name}", f"controller::{name}")
    for name in SETPOINTS:
        structure.make_real_connection(f"controller::{name}", f"grid::{name}")

    with EcosSimulation(structure=structure, step_size=STEP) as simulation:
        simulation.init()
        journal = Journal()
        for k in range(STEPS):
            for fmu, name, value in events_at(k):
                setter = simulation.set_bool if isinstance(value, bool) else simulation.set_real
                setter(f"{fmu}::{name}", value)
            simulation.step(1)
            rows = {fmu: [simulation.get_real(f"{fmu}::{name}") for name in OBSERVED[fmu]] for fmu in OBSERVED}
            journal.add(**rows)
        journal.report("Ecos", importlib.metadata.version("ecospy"))
        simulation.terminate()
