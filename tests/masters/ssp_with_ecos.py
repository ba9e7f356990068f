#!/usr/bin/env python3
"""The system that `bess export system` writes, opened in Ecos. The parameter set is called by its name."""

import importlib.metadata

from case1 import OBSERVED, STEP, STEPS, Journal, fmus
from ecospy.EcosSimulation import EcosSimulation

with EcosSimulation(ssp_path=str(fmus() / "BessSystem.ssp"), step_size=STEP) as simulation:
    simulation.init(parameter_set="scenario")
    journal = Journal(moving_from=0.0)
    for k in range(STEPS):
        simulation.step(1)
        rows = {fmu: [simulation.get_real(f"{fmu}::{name}") for name in OBSERVED[fmu]] for fmu in OBSERVED}
        journal.add(**rows)
    journal.report("Ecos, .ssp", importlib.metadata.version("ecospy"), "case1_from_start")
    simulation.terminate()
