"""What every master here has in common: who is connected to whom, what happens when, and what is written down.

Case 1 of the paper, shortened: seven batteries on the islanded IEEE 57-bus system. The controller is turned on at
5 s, a load drops at 15 s, and at 40 s everything has long been at rest. All quantities are per unit.
"""

import argparse
import json
import pathlib
import sys
import time
import xml.etree.ElementTree as ElementTree
import zipfile

STEP = 0.01
STOP = 40.0
STEPS = round(STOP / STEP)

AGENTS = range(1, 8)
MEASUREMENTS = [f"{q}[{i}]" for q in ("P", "Q", "V", "omega", "E") for i in AGENTS]
SETPOINTS = [f"{q}[{i}]" for q in ("omega_set", "V_set", "P_set", "Q_set") for i in AGENTS]

# (time, FMU, input, value): nothing but these changes on the way.
EVENTS = [
    (5.0, "controller", "enable", True),
    (15.0, "grid", "dP_load[12]", -0.5),
    (15.0, "grid", "dQ_load[12]", -0.5),
]

# What is looked at after each step: outputs, and two inputs of the controller as it has them.
INPUTS = ["omega[1]", "P[1]"]
OBSERVED = {
    "controller": [f"{q}[{i}]" for q in ("omega_set", "P_set") for i in AGENTS] + ["spread_P", *INPUTS],
    "grid": [f"{q}[{i}]" for q in ("omega", "V", "P", "Q") for i in AGENTS],
}
K_P = [0.004, 0.0048, 0.005, 0.0036, 0.0038, 0.00408, 0.0044]


def events_at(step):
    """The changes that are due before this step (counted from 0)."""
    return [(fmu, name, value) for at, fmu, name, value in EVENTS if round(at / STEP) == step]


def portable(name):
    """What `bess export --portable` calls a variable: P_1 for P[1]."""
    return name.replace("[", "_").replace("]", "")


def command_line():
    """What all these scripts understand: the folder of the FMUs."""
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__)
    parser.add_argument("fmus", nargs="?", default="fmu", type=pathlib.Path, help="folder of the FMUs [default: fmu]")
    return parser


def fmus():
    """The folder of the FMUs."""
    return command_line().parse_args().fmus.resolve()


def variables(fmu):
    """The variables of an FMU: {name: (value reference, type, causality, start)}."""
    root = ElementTree.fromstring(zipfile.ZipFile(fmu).read("modelDescription.xml"))
    return {
        v.get("name"): (int(v.get("valueReference")), v[0].tag, v.get("causality"), v[0].get("start"))
        for v in root.iter("ScalarVariable")
    }


class Journal:
    """The observed outputs after each step, and what follows from them."""

    def __init__(self, moving_from=EVENTS[0][0]):
        self.rows = {"controller": [], "grid": []}
        self.moving_from = moving_from
        self.begin = time.perf_counter()

    def add(self, controller, grid):
        """The values of OBSERVED["controller"] and OBSERVED["grid"] after a step; None for what cannot be seen."""
        self.rows["controller"].append(controller)
        self.rows["grid"].append(grid)

    def column(self, fmu):
        return dict(zip(OBSERVED[fmu], zip(*self.rows[fmu])))

    def report(self, master, version, scenario="case1_short"):
        """Prints one line of JSON: where it all came to rest, how late measurements were, how fast it went."""
        steps, seconds = len(self.rows["grid"]), time.perf_counter() - self.begin
        grid = self.column("grid")
        result = {
            "master": master,
            "version": version,
            "scenario": scenario,
            "delay": self.delay(),
            "steps": steps,
            "steps_per_second": round(steps / seconds),
            "end": {q: [grid[f"{q}[{i}]"][-1] for i in AGENTS] for q in ("omega", "V", "P", "Q")},
        }
        print(json.dumps(result), flush=True)

    def delay(self):
        """How many steps late the controller measures what its setpoints do; None if that cannot be told.

        The frequency at no load, omega + K_P P, is that of the setpoints, omega_set + K_P P_set, some steps ago, and
        in the step that the controller makes next it should be the present one: delay 0. Whether the inputs that are
        seen after a step are those of this step or of the next already, P tells: it is a state of the grid.
        """
        controller, grid = self.column("controller"), self.column("grid")
        first = round(self.moving_from / STEP) + 10
        rows = range(first, first + 100)

        def lag(late, early):
            fits = (k for k in range(6) if all(abs(late(n) - early(n - k)) < 1e-12 for n in rows))
            return next(fits, None)

        def commanded(n):
            return controller["omega_set[1]"][n] + K_P[0] * controller["P_set[1]"][n]

        def measured(fmu):
            omega, P = fmu["omega[1]"], fmu["P[1]"]
            return lambda n: omega[n] + K_P[0] * P[n]

        def spread(n):
            scaled = [K * grid[f"P[{i}]"][n] for i, K in zip(AGENTS, K_P)]
            return max(scaled) - min(scaled)

        if None not in controller["omega[1]"]:
            whole = lag(measured(controller), commanded)
            step_made = lag(lambda n: controller["P[1]"][n], lambda n: grid["P[1]"][n])
            return None if None in (whole, step_made) else whole - min(step_made, 1)
        # Where inputs cannot be seen: the way there, and back by an output that follows P at once.
        there, back = lag(measured(grid), commanded), lag(lambda n: controller["spread_P"][n], spread)
        return None if None in (there, back) else there + back - 1
