"""One FMU in FMPy, as a few lines of one's own: for loops, federates and adapters that step FMUs themselves."""

import shutil

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave


class Slave:
    """One instance, ready to step; `get` and `set` take names of any type."""

    def __init__(self, file, name, start=()):
        self.folder = extract(str(file))
        description = read_model_description(self.folder)
        self.variables = {v.name: v for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        for name, value in dict(start).items():
            self.set([name], [value])
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def get(self, names):
        """The values of Real variables."""
        return list(self.fmu.getReal([self.variables[name].valueReference for name in names]))

    def set(self, names, values):
        """Sets variables that are all of one type."""
        kinds = {self.variables[name].type for name in names}
        assert len(kinds) == 1, f"{kinds}: one call for each type"
        set_values = getattr(self.fmu, f"set{kinds.pop()}")
        set_values([self.variables[name].valueReference for name in names], list(values))

    def step(self, k, h):
        """The k-th step of length h, s. Time is counted, not summed."""
        self.fmu.doStep(currentCommunicationPoint=k * h, communicationStepSize=h)

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)
