"""One FMU instance in FMPy, with its arrays folded by quantity; and a Jacobi loop over two of them.

Knows FMI and nothing of batteries. `get("P")` is an array over all agents, `get("P[3]")` one number.
"""

import ctypes
import functools
import re
import struct

import numpy as np
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy import calloc, free
from fmpy.logging import addLoggerProxy

LOG = []
"""Every line that any FMU has logged in this process: (instance, status, category, message)."""


def _log(_environment, instance, status, category, message):
    LOG.append(tuple(x.decode() if isinstance(x, bytes) else x for x in (instance, status, category, message)))


CALLBACKS = fmi2CallbackFunctions()
CALLBACKS.logger = fmi2CallbackLoggerTYPE(_log)
CALLBACKS.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
CALLBACKS.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
# FMPy's C helper formats the variadic message; it keeps one Python logger for the whole process.
addLoggerProxy(ctypes.byref(CALLBACKS))


@functools.cache
def described(folder, validate):
    """The description of an unpacked FMU, read once; whoever tests an FMU makes many instances of it."""
    return read_model_description(folder, validate=validate)


class Fmu:
    """An instance, from instantiation to `close()`; also a context manager."""

    def __init__(self, folder, name, guid=None, validate=True):
        self.description = described(str(folder), validate)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.arrays = fold(self.variables)
        self.log_from = len(LOG)
        self.slave = FMU2Slave(
            guid=self.description.guid if guid is None else guid,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.slave.instantiate(callbacks=CALLBACKS, loggingOn=True)
        self.initialized = False

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Terminates if that is due, and frees. A second call does nothing."""
        if self.slave is None:
            return
        if self.initialized:
            self.slave.terminate()
        self.slave.freeInstance()
        self.slave = None

    def log(self):
        """The lines logged since this instance was made."""
        return [message for _, _, _, message in LOG[self.log_from :]]

    def names(self, quantity):
        """The variables of a quantity, in order; of a scalar or a single element, itself."""
        return [quantity] if quantity in self.variables else self.arrays[quantity]

    def get(self, quantity):
        """The values of a quantity as an array, or one value."""
        if quantity in self.variables:
            return self.get_all([quantity])[0]
        return np.array(self.get_all(self.arrays[quantity]))

    def set(self, quantity, value):
        """Sets a quantity, an element, or all elements to one value."""
        names = self.names(quantity)
        self.set_all(names, np.broadcast_to(value, len(names)))

    def get_all(self, names):
        """The values of variables of any types, one call per type."""
        values = dict.fromkeys(names)
        for kind, members in self._by_type(names).items():
            references = [self.variables[name].valueReference for name in members]
            values.update(zip(members, getattr(self.slave, f"get{kind}")(references)))
        return [values[name] for name in names]

    def set_all(self, names, values):
        """Sets variables of any types, one call per type."""
        convert = {"Real": float, "Integer": int, "Boolean": bool}
        given = dict(zip(names, values))
        for kind, members in self._by_type(names).items():
            references = [self.variables[name].valueReference for name in members]
            getattr(self.slave, f"set{kind}")(references, [convert[kind](given[name]) for name in members])

    def _by_type(self, names):
        kinds = {}
        for name in names:
            kinds.setdefault(self.variables[name].type, []).append(name)
        return kinds

    def setup(self, values=None, start=0.0, stop=None):
        """Sets up the experiment and start values, and enters initialisation mode."""
        self.slave.setupExperiment(startTime=start, stopTime=stop)
        for quantity, value in (values or {}).items():
            self.set(quantity, value)
        self.slave.enterInitializationMode()

    def initialize(self, values=None, start=0.0, stop=None):
        """From instantiated to ready to step."""
        self.setup(values, start, stop)
        self.ready()
        return self

    def ready(self):
        """Leaves initialisation mode."""
        self.slave.exitInitializationMode()
        self.initialized = True

    def step(self, time, step):
        """One communication step."""
        self.slave.doStep(time, step)

    def reset(self):
        """Back to the state after instantiation."""
        self.slave.reset()
        self.initialized = False

    def everything(self):
        """All values of all variables as bytes: equal bytes are equal to the last bit."""
        values = self.get_all(list(self.variables))
        return b"".join(struct.pack("d", v) for v in values)

    def of_causality(self, causality):
        """Names of the inputs, outputs or parameters, in order."""
        return [v.name for v in self.variables.values() if v.causality == causality]


def fold(names):
    """`P[1]`, `P[2]`, ... folded into `P`, in order of the index, which counts from 1 without gaps."""
    arrays = {}
    for name in names:
        if element := re.fullmatch(r"(\w+)\[(\d+)\]", name):
            arrays.setdefault(element[1], {})[int(element[2])] = name
    for quantity, elements in arrays.items():
        assert sorted(elements) == list(range(1, len(elements) + 1)), f"{quantity}: {sorted(elements)}"
    return {quantity: [elements[i] for i in sorted(elements)] for quantity, elements in arrays.items()}


class Pair:
    """Two FMUs coupled by equal names, output to input, stepped together (Jacobi)."""

    def __init__(self, first, second):
        self.members = (first, second)
        self.links = [(a, b, common(a, b)) for a, b in (self.members, self.members[::-1])]

    def exchange(self):
        """Reads all connected outputs, then sets all inputs."""
        read = [source.get_all(names) for source, _, names in self.links]
        for (_, target, names), values in zip(self.links, read):
            target.set_all(names, values)

    def initialize(self, values=({}, {}), start=0.0):
        """Initialises both so that each begins with the other's start values."""
        for member, given in zip(self.members, values):
            member.setup(given, start)
        # Two passes: the first carries setpoints there, the second what they make of the other side.
        self.exchange()
        self.exchange()
        for member in self.members:
            member.ready()
        return self

    def run(self, stop, step, schedule=(), observe=None, start=0.0):
        """Steps to `stop`; `schedule` is [(time, member index, quantity, value)], set before reading.

        `observe(time)` is called at every communication point, inputs set.
        """
        pending = sorted(schedule, key=lambda event: event[0])
        for k in range(round((stop - start) / step) + 1):
            time = start + k * step
            while pending and pending[0][0] <= time + 1e-9:
                _, index, quantity, value = pending.pop(0)
                self.members[index].set(quantity, value)
            self.exchange()
            if observe:
                observe(time)
            if time < stop - step / 2:
                for member in self.members:
                    member.step(time, step)


def common(source, target):
    """The outputs of one that are inputs of the other by name."""
    inputs = set(target.of_causality("input"))
    return [name for name in source.of_causality("output") if name in inputs]


__all__ = ["CALLBACKS", "FMICallException", "Fmu", "LOG", "Pair", "common", "fold"]
