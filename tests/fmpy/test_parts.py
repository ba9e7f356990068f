"""The controller in parts, one FMU for each cluster or battery, coupled with the grid in an FMPy loop."""

import json
import pathlib
import subprocess
import sys

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import ParameterSet, read_ssv
from fmus import Fmu

STEP = 0.01


class Parts:
    """The exported parts of a scenario, connected as their resources say."""

    def __init__(self, bess, folder, scenario, kind, count):
        self.fmus, self.parts = [], []
        for number in range(1, count + 1):
            archive = folder / f"{kind}{number}.fmu"
            export(bess, kind, str(number), scenario, "-o", archive)
            self.fmus.append(Fmu(pathlib.Path(fmpy.extract(archive)), f"{kind}{number}"))
            resource = json.loads((pathlib.Path(self.fmus[-1].slave.unzipDirectory) / "resources/controller.json").read_text())
            self.parts.append((resource["config"]["part"], resource["config"]["communication"]["explicit"]))
        self.own = [[a for a in p["agents"] if a not in outside(p)] for p, _ in self.parts]
        self.ways = []
        for to, (part, _) in enumerate(self.parts):
            for slot, neighbour in enumerate(part["outside"], start=1):
                source = neighbour["part"] - 1
                place = tellers(*self.parts[source]).index(neighbour["agent"]) + 1
                self.ways.append((source, place, to, slot))
        self.words = [q.removeprefix("local_") for q in self.fmus[0].arrays if q.startswith("local_")]

    def connections(self):
        """[(source FMU, output, target FMU, input)] of all messages."""
        return [
            (self.fmus[source], f"local_{word}[{place}]", self.fmus[target], f"remote_{word}[{slot}]")
            for source, place, target, slot in self.ways
            for word in self.words
        ]

    def close(self):
        for fmu in self.fmus:
            fmu.close()


def outside(part):
    return [neighbour["agent"] for neighbour in part["outside"]]


def tellers(part, explicit):
    """Own agents with an edge to one outside in any graph; all of them where leaders are elected."""
    if "election" in part:
        return [agent for agent in part["agents"] if agent not in outside(part)]
    found = set()
    for topology in explicit["topologies"]:
        for edge in topology["edges"]:
            a, b = (part["agents"][edge[end] - 1] for end in "ab")
            found |= {x for x, y in [(a, b), (b, a)] if x not in outside(part) and y in outside(part)}
    return sorted(found)


def export(bess, *arguments):
    subprocess.run([bess, "export", *arguments], check=True, stdout=sys.stderr)


def couple(parts, grid, stop, schedule):
    """Outputs to inputs, then a step of everybody: as any Jacobi master does it."""
    wires = parts.connections()
    for fmu, own in zip(parts.fmus, parts.own):
        for place, agent in enumerate(own, start=1):
            for quantity in ["P", "Q", "V", "omega", "E"]:
                wires.append((grid, f"{quantity}[{agent}]", fmu, f"{quantity}[{place}]"))
            for quantity in ["omega_set", "V_set", "P_set", "Q_set"]:
                wires.append((fmu, f"{quantity}[{place}]", grid, f"{quantity}[{agent}]"))
    ends = {}
    for source, output, target, name in wires:
        outputs, inputs = ends.setdefault((source, target), ([], []))
        outputs.append(output)
        inputs.append(name)

    def exchange():
        read = [source.get_all(outputs) for (source, _), (outputs, _) in ends.items()]
        for ((_, target), (_, inputs)), values in zip(ends.items(), read):
            target.set_all(inputs, values)

    everybody = [*parts.fmus, grid]
    for fmu in everybody:
        fmu.setup()
    exchange()
    exchange()
    for fmu in everybody:
        fmu.ready()
    for k in range(round(stop / STEP)):
        for time, fmus, quantity, value in schedule:
            if round(time / STEP) == k:
                for fmu in fmus:
                    fmu.set(quantity, value)
        exchange()
        for fmu in everybody:
            fmu.step(k * STEP, STEP)
    exchange()


@pytest.mark.parametrize("kind, count", [("cluster", 2), ("agent", 7)])
def test_frequency_is_restored_and_power_is_shared_across_parts(bess, grid, tmp_path, kind, count):
    parts = Parts(bess, tmp_path, "case1", kind, count)
    try:
        assert sorted(sum(parts.own, [])) == list(range(1, 8))
        schedule = [
            (2.0, parts.fmus, "enable", True),
            (22.0, [grid], "dP_load[12]", -0.5),
            (22.0, [grid], "dQ_load[12]", -0.5),
        ]
        couple(parts, grid, 60.0, schedule)
        K_P, P_set = np.zeros(7), np.zeros(7)
        for fmu, own in zip(parts.fmus, parts.own):
            K_P[np.array(own) - 1] = fmu.get("K_P")
            P_set[np.array(own) - 1] = fmu.get("P_set")
        assert np.abs(grid.get("omega") - 1).max() < 1e-6
        assert np.ptp(K_P * (grid.get("P") - P_set)) < 1e-5
        # Energy is exchanged, within the clusters and between them, and none is made.
        assert np.abs(P_set).max() > 1e-3
        assert abs(P_set.sum()) < 1e-12
    finally:
        parts.close()


def test_messages_are_sampled_and_a_part_alone_hears_nobody(bess, tmp_path):
    export(bess, "cluster", "2", "case1", "-o", tmp_path / "two.fmu")
    with Fmu(pathlib.Path(fmpy.extract(tmp_path / "two.fmu")), "two") as fmu:
        unknowns = {u.variable.name: u for u in fmu.description.outputs}
        for name in (name for name in unknowns if name.startswith("local_")):
            assert unknowns[name].dependencies == [], f"{name}: a loop for masters that look for one"
        assert {v.name for v in unknowns["u_P[1]"].dependencies} & set(fmu.of_causality("input"))
        for name in ["lambda_2", "T_P", "T_omega"]:
            assert name not in fmu.variables
        assert not any(fmu.get("remote_available"))
        fmu.initialize({"enable": True, "P": 0.7})
        told = fmu.get("local_p").copy()
        assert (told > 0).all(), "before the first step they follow the measurements"
        fmu.set("P", 0.9)
        assert (fmu.get("local_p") == told).all(), "of the last step, whatever is measured since"
        fmu.step(0.0, STEP)
        assert (fmu.get("local_p") > told).all()


def test_the_system_of_parts_opens_in_fmpy(bess, tmp_path):
    system = str(tmp_path / "parts.ssp")
    export(bess, "clusters", "case1", "-o", system)
    # FMPy takes the start values as one set, with the name of the component in front.
    start = ParameterSet(name="scenario")
    for component in ("cluster1", "cluster2", "grid"):
        for parameter in read_ssv(system, f"resources/{component}-scenario.ssv").parameters:
            parameter.name = f"{component}.{parameter.name}"
            start.parameters.append(parameter)
    result = simulate_ssp(system, stop_time=30.0, step_size=STEP, parameter_set=start)
    omega = np.array([result[f"grid.omega[{i}]"] for i in range(1, 8)])
    assert np.abs(omega[:, 0] - 1).max() > 1e-4
    assert np.abs(omega[:, -1] - 1).max() < 1e-5
