#!/usr/bin/env python3
"""Couple the BESS controller with a grid, both FMUs, in a loop of FMPy (FMI 2.0 co-simulation).

Copy this file and put your own grid in the place of BessGrid.fmu: all that matters is which of its
outputs are P, Q, V, omega and E of each battery, and which inputs take the setpoints.

What runs here is Case 1: seven batteries on the IEEE 57-bus system, islanded. Droop alone lets the
frequency sag and shares the load unevenly; the controller is enabled at 20 s, load is taken off
bus 12 at 50 s and put on at 80 s. All quantities are per unit.

    pip install fmpy==0.3.32
    cargo xtask fmu
    python examples/couple_fmpy.py
"""

import argparse
import pathlib
import shutil

import fmpy
from fmpy.fmi2 import FMU2Slave

FMU_FOLDER = pathlib.Path(__file__).resolve().parents[1] / "fmu"


class Slave:
    """One FMU. Its variables are named `P[1]`, `P[2]`, ...; here `P` stands for all of them."""

    def __init__(self, file, name):
        self.folder = fmpy.extract(file)
        description = fmpy.read_model_description(self.folder)
        self.variables = {v.name: v for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()

    def references(self, quantity):
        """FMI knows variables by number; these are the numbers of `quantity[1]`, `quantity[2]`, ..."""
        references, i = [], 1
        while variable := self.variables.get(f"{quantity}[{i}]"):
            references.append(variable.valueReference)
            i += 1
        return references

    def get(self, quantity):
        return self.fmu.getReal(self.references(quantity))

    def set(self, quantity, values):
        self.fmu.setReal(self.references(quantity), values)

    def set_one(self, name, value):
        variable = self.variables[name]
        setter = {"Real": self.fmu.setReal, "Integer": self.fmu.setInteger, "Boolean": self.fmu.setBoolean}
        setter[variable.type]([variable.valueReference], [value])

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)


# What the grid measures at each battery, and what the controller tells each battery.
# With a grid of your own: its names for these go here.
MEASUREMENTS = ["P", "Q", "V", "omega", "E"]
SETPOINTS = ["omega_set", "V_set", "P_set", "Q_set"]


def exchange(controller, grid):
    """Setpoints first, then what the grid makes of them at once: so nothing arrives a step late.

    A master that reads both sides before it writes either (Jacobi) works as well: the controller notices that
    its measurements are late and allows for it.
    """
    commanded = {name: controller.get(name) for name in SETPOINTS}
    for name, values in commanded.items():
        grid.set(name, values)
    measured = {name: grid.get(name) for name in MEASUREMENTS}
    for name, values in measured.items():
        controller.set(name, values)
    return commanded, measured


def simulate(options):
    controller = Slave(options.controller, "controller")
    grid = Slave(options.grid, "grid")
    slaves = [controller, grid]

    # 1. Experiment and parameters. Tunable parameters, such as eta, may also be set between steps.
    for slave in slaves:
        slave.fmu.setupExperiment(startTime=0.0)
    controller.set_one("eta", options.eta)

    # 2. Initialisation: the grid begins in the steady state of the controller's first setpoints.
    for slave in slaves:
        slave.fmu.enterInitializationMode()
    exchange(controller, grid)
    for slave in slaves:
        slave.fmu.exitInitializationMode()

    # 3. Time is counted in steps, not summed up, so that every event meets its step exactly.
    h = options.step
    events = {
        round(options.enable_at / h): [(controller, "enable", True)],
        round(options.load_at / h): [(grid, "dP_load[12]", -0.5), (grid, "dQ_load[12]", -0.5)],
        # The inputs hold the total change: -0.5 and then +1 make +0.5.
        round(options.load_back_at / h): [(grid, "dP_load[12]", 0.5), (grid, "dQ_load[12]", 0.5)],
    }
    gains = [float(v.start) for name, v in sorted_elements(controller, "K_P")]
    rows = []
    steps = round(options.stop / h)
    for k in range(steps + 1):
        for slave, name, value in events.get(k, []):
            slave.set_one(name, value)
        commanded, measured = exchange(controller, grid)
        shares = [K * (P - P_set) for K, P, P_set in zip(gains, measured["P"], commanded["P_set"])]
        rows.append((k * h, measured["omega"], shares, measured["V"]))
        if k < steps:
            for slave in slaves:
                slave.fmu.doStep(currentCommunicationPoint=k * h, communicationStepSize=h)

    for slave in slaves:
        slave.close()
    return rows


def sorted_elements(slave, quantity):
    prefix = quantity + "["
    elements = [(name, v) for name, v in slave.variables.items() if name.startswith(prefix)]
    return sorted(elements, key=lambda element: int(element[0][len(prefix) : -1]))


def print_table(rows, every):
    print("  t, s   worst omega - 1     K_P (P - P_set) spread    mean V     (pu)")
    stride = max(1, round(every / (rows[1][0] - rows[0][0]))) if len(rows) > 1 else 1
    for t, omega, shares, V in rows[::stride] + ([rows[-1]] if (len(rows) - 1) % stride else []):
        worst = max(omega, key=lambda value: abs(value - 1)) - 1
        print(f"{t:6.1f}   {worst:15.3e}   {max(shares) - min(shares):24.3e}   {sum(V) / len(V):7.5f}")


def plot(rows):
    try:
        from matplotlib import pyplot
    except ImportError:
        print("(no matplotlib here, hence no plot)")
        return
    time = [row[0] for row in rows]
    figure, axes = pyplot.subplots(3, sharex=True, figsize=(8, 8))
    for axis, column, label in zip(axes, (1, 2, 3), ("omega, pu", "K_P (P - P_set), pu", "V, pu")):
        axis.plot(time, [row[column] for row in rows], linewidth=1)
        axis.set_ylabel(label)
    axes[-1].set_xlabel("t, s")
    axes[0].legend([f"BESS {i + 1}" for i in range(len(rows[0][1]))], fontsize="small", ncol=2)
    figure.tight_layout()
    pyplot.show()


def main():
    parser = argparse.ArgumentParser(
        description=__doc__.split("\n\n")[0],
        epilog="example: couple_fmpy.py --eta 0.3 --step 0.1 --stop 60",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--controller", default=FMU_FOLDER / "BessConsensus.fmu", help="the controller FMU")
    parser.add_argument("--grid", default=FMU_FOLDER / "BessGrid.fmu", help="the grid FMU")
    parser.add_argument("--step", type=float, default=0.01, help="communication step, s")
    parser.add_argument("--stop", type=float, default=120.0, help="end of the simulation, s")
    parser.add_argument("--eta", type=float, default=0.5, help="exponent of the consensus law, in (0, 1)")
    parser.add_argument("--enable-at", type=float, default=20.0, help="the controller is enabled, s")
    parser.add_argument("--load-at", type=float, default=50.0, help="load -(0.5 + 0.5j) at bus 12, s")
    parser.add_argument("--load-back-at", type=float, default=80.0, help="load +(1 + 1j) at bus 12, s")
    parser.add_argument("--every", type=float, default=5.0, help="seconds between two lines of the table")
    parser.add_argument("--no-plot", action="store_true", help="only the table, even with matplotlib")
    options = parser.parse_args()
    for file in (options.controller, options.grid):
        if not pathlib.Path(file).is_file():
            parser.error(f"{file} is missing; `cargo xtask fmu` makes both FMUs")

    rows = simulate(options)
    print_table(rows, options.every)
    if not options.no_plot:
        plot(rows)


if __name__ == "__main__":
    main()
