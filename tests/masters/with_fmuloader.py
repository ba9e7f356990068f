#!/usr/bin/env python3
"""Controller and grid in a loop of fmuloader. It knows variables by number; the names come from the description."""

import importlib.metadata
import xml.etree.ElementTree as ElementTree
import zipfile

from case1 import MEASUREMENTS, OBSERVED, SETPOINTS, STEP, STEPS, Journal, events_at, fmus, variables
from fmuloader.fmi2 import Fmi2Slave, Fmi2Type


MODEL_EXCHANGE = """EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime
SetContinuousStates GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates""".split()


class CoSimulationSlave(Fmi2Slave):
    """fmuloader 0.1.2rc0 looks up the functions of model exchange in every library; one for co-simulation has none."""

    def _bind_functions(self):
        for name in MODEL_EXCHANGE:
            if not hasattr(self._dll, f"fmi2{name}"):
                setattr(self._dll, f"fmi2{name}", lambda *_: 3)
        super()._bind_functions()


class Slave:
    """One instance, ready to step."""

    def __init__(self, file, name):
        self.variables = variables(file)
        description = ElementTree.fromstring(zipfile.ZipFile(file).read("modelDescription.xml"))
        identifier = description.find("CoSimulation").get("modelIdentifier")
        self.fmu = CoSimulationSlave(str(file), model_identifier=identifier)
        self.fmu.instantiate(name, Fmi2Type.CO_SIMULATION, guid=description.get("guid"))
        self.fmu.setup_experiment(start_time=0.0)
        self.fmu.enter_initialization_mode()
        self.fmu.exit_initialization_mode()

    def references(self, names):
        return [self.variables[name][0] for name in names]

    def get(self, names):
        return list(self.fmu.get_real(self.references(names)))

    def set(self, names, values):
        kind = {"Real": "real", "Integer": "integer", "Boolean": "boolean"}[self.variables[names[0]][1]]
        getattr(self.fmu, f"set_{kind}")(self.references(names), list(values))

    def close(self):
        self.fmu.terminate()
        self.fmu.free_instance()


folder = fmus()
slaves = {
    "controller": Slave(folder / "BessConsensus.fmu", "controller"),
    "grid": Slave(folder / "BessGrid.fmu", "grid"),
}
controller, grid = slaves["controller"], slaves["grid"]

# Gauss-Seidel: the grid takes the setpoints, and the controller what the grid makes of them at once.
journal = Journal()
for k in range(STEPS):
    for fmu, name, value in events_at(k):
        slaves[fmu].set([name], [value])
    grid.set(SETPOINTS, controller.get(SETPOINTS))
    controller.set(MEASUREMENTS, grid.get(MEASUREMENTS))
    for slave in slaves.values():
        slave.fmu.do_step(k * STEP, STEP)
    journal.add(controller.get(OBSERVED["controller"]), grid.get(OBSERVED["grid"]))

journal.report("fmuloader", importlib.metadata.version("fmuloader"))
for slave in slaves.values():
    slave.close()
