#!/usr/bin/env python3
"""Controller and grid in mosaik 3: one simulator per FMU through FMPy, and one that knows when what happens."""

import importlib.metadata
import sys

import mosaik
import mosaik_api_v3
from case1 import EVENTS, MEASUREMENTS, OBSERVED, SETPOINTS, STEP, STEPS, Journal, fmus
from slave import Slave

ROWS = {}


class FmuSimulator(mosaik_api_v3.Simulator):
    """One FMU; one mosaik step is one communication step."""

    def __init__(self):
        model = {"public": True, "params": [], "attrs": []}
        super().__init__({"api_version": "3.0", "type": "time-based", "models": {"Fmu": model}})

    def init(self, sid, time_resolution, fmu, name):
        self.slave, self.name, self.h = Slave(fmu, name), name, time_resolution
        self.meta["models"]["Fmu"]["attrs"] = list(self.slave.variables)
        ROWS[name] = []
        return self.meta

    def create(self, num, model):
        return [{"eid": self.name, "type": model}]

    def step(self, time, inputs, max_advance):
        for name, sources in inputs.get(self.name, {}).items():
            self.slave.set([name], sources.values())
        self.slave.step(time, self.h)
        ROWS[self.name].append(self.slave.get(OBSERVED[self.name]))
        return time + 1

    def get_data(self, outputs):
        return {eid: dict(zip(names, self.slave.get(names))) for eid, names in outputs.items()}

    def finalize(self):
        self.slave.close()


class Schedule(mosaik_api_v3.Simulator):
    """The inputs that change on the way, as outputs of a simulator."""

    def __init__(self):
        model = {"public": True, "params": [], "attrs": [name for _, _, name, _ in EVENTS]}
        super().__init__({"api_version": "3.0", "type": "time-based", "models": {"Schedule": model}})

    def init(self, sid, time_resolution):
        self.now, self.h = 0, time_resolution
        return self.meta

    def create(self, num, model):
        return [{"eid": "schedule", "type": model}]

    def step(self, time, inputs, max_advance):
        self.now = time
        return time + 1

    def get_data(self, outputs):
        # False and 0 before, of the type of the value after.
        values = {name: value if self.now >= round(at / self.h) else type(value)(0) for at, _, name, value in EVENTS}
        return {"schedule": {name: values[name] for name in outputs["schedule"]}}


folder = fmus()
here = sys.modules[__name__]
world = mosaik.World(
    {"Fmu": {"python": f"{here.__name__}:FmuSimulator"}, "Schedule": {"python": f"{here.__name__}:Schedule"}},
    time_resolution=STEP,
)
controller = world.start("Fmu", fmu=str(folder / "BessConsensus.fmu"), name="controller").Fmu()
grid = world.start("Fmu", fmu=str(folder / "BessGrid.fmu"), name="grid").Fmu()
schedule = world.start("Schedule").Schedule()

# Every loop of mosaik needs one connection with a delay: the grid's values arrive a step later.
first = dict(zip(MEASUREMENTS, Slave(folder / "BessGrid.fmu", "start").get(MEASUREMENTS)))
world.connect(controller, grid, *[(name, name) for name in SETPOINTS])
world.connect(grid, controller, *[(name, name) for name in MEASUREMENTS], time_shifted=True, initial_data=first)
for _, fmu, name, _ in EVENTS:
    world.connect(schedule, {"controller": controller, "grid": grid}[fmu], (name, name))

journal = Journal()
world.run(until=STEPS, print_progress=False)
for rows in zip(ROWS["controller"], ROWS["grid"]):
    journal.add(*rows)
journal.report("mosaik", importlib.metadata.version("mosaik"))
