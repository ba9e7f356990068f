#!/usr/bin/env python3
"""The system that `bess export system` writes, opened in libcosim. Start values and all stand in the file."""

import importlib.metadata

from case1 import OBSERVED, STEP, STEPS, Journal, fmus
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver

log_output_level(CosimLogLevel.WARNING)
execution = CosimExecution.from_ssp_file(str(fmus() / "BessSystem.ssp"), step_size=STEP * 1e9)
index = {info.name.decode(): info.index for info in execution.slave_infos()}
references = {
    fmu: {variable.name.decode(): variable.reference for variable in execution.slave_variables(index[fmu])}
    for fmu in OBSERVED
}
observer = CosimObserver.create_last_value()
execution.add_observer(observer)

journal = Journal(moving_from=0.0)
for k in range(STEPS):
    assert execution.step()
    rows = {
        fmu: list(observer.last_real_values(index[fmu], [references[fmu][name] for name in names]))
        for fmu, names in OBSERVED.items()
    }
    journal.add(**rows)
journal.report("libcosim, .ssp", importlib.metadata.version("libcosimpy"), "case1_from_start")
