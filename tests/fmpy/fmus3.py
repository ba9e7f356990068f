"""One FMI 3.0 instance in FMPy: `get("P")` is the array, sizes follow what is set in configuration mode.

Knows FMI and nothing of batteries.
"""

import struct

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave

from fmus import described


class Fmu3:
    """An instance, from instantiation to `close()`."""

    def __init__(self, folder, name="fmu", **options):
        self.description = described(str(folder), True)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.sizes = {v.name: int(v.start) for v in self.variables.values() if v.causality == "structuralParameter"}
        self.lines = []
        self.slave = FMU3Slave(
            guid=options.pop("token", self.description.instantiationToken),
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.slave.instantiate(loggingOn=True, logMessage=self._log, **options)

    def _log(self, _environment, status, category, message):
        self.lines.append((status, category.decode(), message.decode()))

    def close(self):
        """Frees. A second call does nothing."""
        if self.slave is not None:
            self.slave.freeInstance()
            self.slave = None

    def refused(self, call, *arguments):
        """The log line of a call that must be refused."""
        before = len(self.lines)
        try:
            call(*arguments)
        except FMICallException as error:
            assert error.status == 3, error
        else:
            raise AssertionError("the call was not refused")
        (line,) = self.lines[before:]
        assert line[:2] == (3, "logStatusError"), line
        return line[2]

    def length(self, name):
        """Number of elements of a variable as the FMU has it now."""
        lengths = [d.start if d.start else self.sizes[d.variable.name] for d in self.variables[name].dimensions]
        return int(np.prod([int(length) for length in lengths])) if lengths else 1

    def get(self, name):
        """A number, or an array."""
        variable = self.variables[name]
        read = getattr(self.slave, f"get{variable.type}")([variable.valueReference], self.length(name))
        return np.array(read) if variable.dimensions else read[0]

    def set(self, name, value):
        """Sets a variable, all elements of an array to one value if it is one."""
        variable = self.variables[name]
        convert = {"Float64": float, "Boolean": bool}.get(variable.type, int)
        values = [convert(v) for v in np.broadcast_to(value, self.length(name))]
        getattr(self.slave, f"set{variable.type}")([variable.valueReference], values)

    def configure(self, **sizes):
        """Other sizes, in configuration mode."""
        self.slave.enterConfigurationMode()
        for name, size in sizes.items():
            self.set(name, size)
        self.slave.exitConfigurationMode()
        self.sizes.update(sizes)

    def initialize(self, values=None, start=0.0):
        """From instantiated to ready to step."""
        for name, value in (values or {}).items():
            self.set(name, value)
        self.slave.enterInitializationMode(startTime=start)
        self.slave.exitInitializationMode()
        return self

    def step(self, time, step):
        """One communication step; the time at its end."""
        event, terminate, early, end = self.slave.doStep(time, step)
        assert not (event or terminate or early)
        return end

    def of_causality(self, causality):
        """Names of the inputs, outputs or parameters, in order."""
        return [v.name for v in self.variables.values() if v.causality == causality]

    def everything(self, causalities=("input", "output", "parameter")):
        """All values of these variables as bytes by name: equal bytes are equal to the last bit."""
        names = [name for causality in causalities for name in self.of_causality(causality)]
        return {name: packed(self.get(name)) for name in names}


def packed(value):
    """The bytes of a number or an array, elements as doubles: whole numbers and truths fit."""
    return b"".join(struct.pack("d", v) for v in np.atleast_1d(np.asarray(value, dtype=float)))


__all__ = ["FMICallException", "Fmu3", "packed"]
