#!/usr/bin/env python3
"""Controller and grid as two federates of HELICS, each a process of its own that steps its FMU through FMPy."""

import importlib.metadata
import multiprocessing
import pathlib
import socket
import subprocess

import helics
from case1 import MEASUREMENTS, OBSERVED, SETPOINTS, STEP, STEPS, Journal, events_at, fmus
from slave import Slave

FILES = {"controller": "BessConsensus.fmu", "grid": "BessGrid.fmu"}
# What each publishes, as one vector.
PUBLISHED = {"controller": SETPOINTS, "grid": MEASUREMENTS}


def federate(name, other, file, port, results):
    information = helics.helicsCreateFederateInfo()
    helics.helicsFederateInfoSetCoreTypeFromString(information, "zmq")
    address = f"--federates=1 --broker_address=127.0.0.1 --brokerport={port}"
    helics.helicsFederateInfoSetCoreInitString(information, address)
    helics.helicsFederateInfoSetTimeProperty(information, helics.helics_property_time_period, STEP)
    helics.helicsFederateInfoSetFlagOption(information, helics.helics_flag_uninterruptible, True)
    own = helics.helicsCreateValueFederate(name, information)
    vector = helics.helics_data_type_vector
    publication = helics.helicsFederateRegisterGlobalPublication(own, name, vector, "")
    subscription = helics.helicsFederateRegisterSubscription(own, other, "")

    slave = Slave(file, name)
    # Published before the start, so that both know the other's first values at time 0.
    helics.helicsFederateEnterInitializingMode(own)
    helics.helicsPublicationPublishVector(publication, slave.get(PUBLISHED[name]))
    helics.helicsFederateEnterExecutingMode(own)
    rows = []
    for k in range(STEPS):
        for fmu, variable, value in events_at(k):
            if fmu == name:
                slave.set([variable], [value])
        slave.set(PUBLISHED[other], helics.helicsInputGetVector(subscription))
        slave.step(k, STEP)
        rows.append(slave.get(OBSERVED[name]))
        helics.helicsPublicationPublishVector(publication, slave.get(PUBLISHED[name]))
        helics.helicsFederateRequestTime(own, (k + 1) * STEP)
    results.put((name, rows))
    helics.helicsFederateDisconnect(own)
    helics.helicsFederateFree(own)
    helics.helicsCloseLibrary()
    slave.close()


def free_port():
    """A port of one's own for each run: a broker that has just ended may still hold the usual one."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def main():
    folder, port = fmus(), free_port()
    broker = pathlib.Path(helics.__file__).parent / "install/bin/helics_broker"
    options = ["-f2", "--coretype=zmq", "--loglevel=warning", "--local_interface=127.0.0.1", f"--port={port}"]
    running = subprocess.Popen([broker, *options])
    try:
        context = multiprocessing.get_context("spawn")
        results = context.Queue()
        journal = Journal()
        names = list(FILES)
        processes = [
            context.Process(target=federate, args=(name, other, folder / FILES[name], port, results))
            for name, other in zip(names, reversed(names))
        ]
        for process in processes:
            process.start()
        rows = dict(results.get(timeout=300) for _ in processes)
        for controller, grid in zip(rows["controller"], rows["grid"]):
            journal.add(controller, grid)
        journal.report("HELICS", importlib.metadata.version("helics"))
        for process in processes:
            process.join(60)
    finally:
        running.terminate()
        running.wait()


if __name__ == "__main__":
    main()
