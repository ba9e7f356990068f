"""The controller FMU in FMPy, and what a settled loop is."""

import shutil

import fmpy
import numpy
from fmpy.fmi2 import FMU2Slave

MEASUREMENTS = ["P", "Q", "V", "omega", "E"]
SETPOINTS = ["omega_set", "V_set", "P_set", "Q_set"]

# Settled: 1e-5 pu of frequency are 0.6 mHz; 1e-5 of K_P P are 0.25 MW, of the 1250 MW that the batteries carry.
# Finer is not to be had while the energy exchange moves P_set and stirs the network.
SETTLED = 1e-5


class Slave:
    """One FMU in FMPy; variables are read and set by name."""

    def __init__(self, file, name):
        self.folder = fmpy.extract(file)
        description = fmpy.read_model_description(self.folder, validate=False)
        self.variables = {v.name: v for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()

    def references(self, names):
        return [self.variables[name].valueReference for name in names]

    def get(self, names):
        return numpy.array(self.fmu.getReal(self.references(names)))

    def set(self, names, values):
        self.fmu.setReal(self.references(names), [float(value) for value in values])

    def step(self, t, h):
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


class Controller(Slave):
    """BessConsensus.fmu, ready to step; quantities are arrays over the batteries."""

    def __init__(self, file, **parameters):
        super().__init__(file, "controller")
        self.n = sum(name.startswith("P[") for name in self.variables)
        self.fmu.setupExperiment(startTime=0.0)
        for quantity, values in parameters.items():
            self.set(self.names(quantity), values)
        self.fmu.enterInitializationMode()

    def names(self, quantity):
        return [f"{quantity}[{i + 1}]" for i in range(self.n)]

    def start(self, measured):
        self.measure(measured)
        self.fmu.exitInitializationMode()

    def measure(self, measured):
        for quantity in MEASUREMENTS:
            self.set(self.names(quantity), measured[quantity])

    def setpoints(self):
        return {quantity: self.get(self.names(quantity)) for quantity in SETPOINTS}

    def enable(self):
        self.fmu.setBoolean(self.references(["enable"]), [True])


class Record:
    """omega and K_P (P - P_set) of all batteries at each step."""

    def __init__(self, K_P):
        self.K_P = K_P
        self.time, self.omega, self.shares = [], [], []

    def add(self, t, measured, setpoints):
        self.time.append(t)
        self.omega.append(numpy.array(measured["omega"]))
        self.shares.append(self.K_P * (measured["P"] - setpoints["P_set"]))

    def worst(self, begin, end):
        """Largest abs(omega - 1) and largest spread of K_P (P - P_set) in these seconds, pu."""
        chosen = [k for k, t in enumerate(self.time) if begin <= t <= end]
        assert chosen
        omega = max(numpy.abs(self.omega[k] - 1).max() for k in chosen)
        return omega, max(numpy.ptp(self.shares[k]) for k in chosen)
