#!/usr/bin/env python3
"""The system that `bess export system` writes, opened in FMPy."""

import fmpy
from case1 import OBSERVED, STEP, STOP, Journal, fmus
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import ParameterSet, read_ssv

system = str(fmus() / "BessSystem.ssp")

# FMPy takes the start values as one set, with the name of the component in front.
start = ParameterSet(name="scenario")
for component in ("controller", "grid"):
    for parameter in read_ssv(system, f"resources/{component}-scenario.ssv").parameters:
        parameter.name = f"{component}.{parameter.name}"
        start.parameters.append(parameter)

journal = Journal(moving_from=0.0)
result = simulate_ssp(system, stop_time=STOP, step_size=STEP, parameter_set=start)
for row in result:
    journal.add(*([float(row[f"{fmu}.{name}"]) for name in OBSERVED[fmu]] for fmu in ("controller", "grid")))
journal.report("FMPy, .ssp", fmpy.__version__, "case1_from_start")
