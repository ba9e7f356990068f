"""The controller FMU in FMPy, and what a settled loop is."""

import numpy
from fmus import Fmu

MEASUREMENTS = ["P", "Q", "V", "omega", "E"]
SETPOINTS = ["omega_set", "V_set", "P_set", "Q_set"]

# Settled: 1e-5 pu of frequency are 0.6 mHz; 1e-5 of K_P P are 0.25 MW, of the 1250 MW that the batteries carry.
# Finer is not to be had while the energy exchange moves P_set and stirs the network.
SETTLED = 1e-5


class Controller(Fmu):
    """BessConsensus.fmu; quantities are arrays over the batteries."""

    def __init__(self, folder, **parameters):
        super().__init__(folder, "controller")
        self.setup(parameters)

    def start(self, measured):
        self.measure(measured)
        self.ready()

    def measure(self, measured):
        for quantity in MEASUREMENTS:
            self.set(quantity, measured[quantity])

    def setpoints(self):
        return {quantity: self.get(quantity) for quantity in SETPOINTS}


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
