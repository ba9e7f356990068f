"""Many instances, their lives and their states: nothing is shared, everything can be repeated to the bit."""

import pathlib
import shutil
import subprocess
import sys
import threading

import fmpy
import numpy as np
import pytest
from fmus import FMICallException, Fmu, Pair

STEP = 0.01
LOADS = [(0.5, 1, "dP_load[12]", -0.5), (0.5, 1, "dQ_load[12]", -0.5)]
ENABLED = ({"enable": True}, {})


def run(pair, stop=2.0, schedule=LOADS, begin=0.0):
    """The bytes of all values of both at every communication point."""
    trace = []
    pair.run(stop, STEP, schedule, lambda _: trace.append([m.everything() for m in pair.members]), begin)
    return trace


def pair(make, name="same name", eta=0.5):
    parameters = ({"enable": True, "eta": eta}, {})
    return Pair(make("controller", name), make("grid", name)).initialize(parameters)


def test_two_pairs_interleaved_give_what_each_gives_alone(make):
    etas = [0.5, 0.3]
    alone = [run(pair(make, eta=eta)) for eta in etas]
    assert alone[0][-1] != alone[1][-1], "the two are different runs"

    together = [pair(make, eta=eta) for eta in etas]
    traces = [[], []]
    for k in range(201):
        for one, trace in zip(together, traces):
            due = LOADS if k == 50 else []
            for _, index, name, value in due:
                one.members[index].set(name, value)
            one.exchange()
            trace.append([m.everything() for m in one.members])
            if k < 200:
                for member in one.members:
                    member.step(k * STEP, STEP)
    assert traces == alone


def test_an_instance_may_step_on_another_thread(make):
    expected = run(pair(make))
    moved, trace = pair(make), []
    worker = threading.Thread(target=lambda: trace.extend(run(moved)))
    worker.start()
    worker.join()
    assert trace == expected


@pytest.mark.parametrize("which", ["controller", "grid"])
def test_reset_gives_back_the_start(make, which):
    fmu = make(which)
    fresh = fmu.everything()
    changed = {"controller": {"eta": 0.3, "enable": True, "P": 1.0}, "grid": {"omega_set": 1.001, "E_start": 0.3}}

    def life():
        fmu.initialize(changed[which])
        for k in range(100):
            fmu.step(k * STEP, STEP)
        return fmu.everything()

    first = life()
    assert first != fresh
    fmu.reset()
    assert fmu.everything() == fresh
    assert life() == first


def test_a_coupled_run_after_reset_is_the_same_to_the_bit(make):
    both = pair(make)
    first = run(both)
    for member in both.members:
        member.reset()
    both.initialize(({"enable": True, "eta": 0.5}, {}))
    assert run(both) == first


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_rollback_and_step_again_is_the_same_to_the_bit(make, delay):
    both = Pair(make("controller"), make("grid")).initialize(({"enable": True, "delay": delay}, {}))
    run(both, 1.0)
    states = [member.slave.getFMUstate() for member in both.members]
    before = [member.everything() for member in both.members]
    first = run(both, 1.5, [], 1.0)
    second = run(both, 2.0, [], 1.5)
    for member, state in zip(both.members, states):
        member.slave.setFMUstate(state)
    assert [member.everything() for member in both.members] == before
    # A state is a copy: it survives being stepped away from, twice.
    assert run(both, 1.5, [], 1.0) == first
    for member, state in zip(both.members, states):
        member.slave.setFMUstate(state)
        member.slave.freeFMUstate(state)
    assert run(both, 1.5, [], 1.0) == first
    assert run(both, 2.0, [], 1.5) == second


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_serialized_states_go_on_in_fresh_instances(make, delay):
    old = Pair(make("controller"), make("grid")).initialize(({"enable": True, "delay": delay}, {}))
    run(old, 1.0)
    saved = []
    for member in old.members:
        state = member.slave.getFMUstate()
        saved.append(member.slave.serializeFMUstate(state))
        member.slave.freeFMUstate(state)
    expected = run(old, 2.0, [], 1.0)

    new = Pair(make("controller", "other"), make("grid", "other")).initialize()
    for member, data in zip(new.members, saved):
        state = member.slave.deSerializeFMUstate(data)
        member.slave.setFMUstate(state)
        member.slave.freeFMUstate(state)
    assert run(new, 2.0, [], 1.0) == expected


CHILD = """
import pathlib, sys
from fmus import Fmu, Pair
root = pathlib.Path(sys.argv[1])
members = [Fmu(sys.argv[2], "child"), Fmu(sys.argv[3], "child")]
pair = Pair(*members).initialize()
for member, name in zip(members, ["controller", "grid"]):
    state = member.slave.deSerializeFMUstate((root / name).read_bytes())
    member.slave.setFMUstate(state)
    member.slave.freeFMUstate(state)
trace = []
pair.run(2.0, 0.01, [], lambda _: trace.extend(member.everything() for member in members), 1.0)
(root / "trace").write_bytes(b"".join(trace))
for member in members:
    member.close()
"""


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_serialized_states_go_on_in_another_process(make, folders, tmp_path, delay):
    """Histories and input derivatives that wait for their step go along."""
    old = Pair(make("controller"), make("grid")).initialize(({"enable": True, "delay": delay}, {}))
    run(old, 1.0)
    waiting = [old.members[1].variables[f"dP_load[{b}]"].valueReference for b in [5, 12]]
    old.members[1].slave.setRealInputDerivatives(waiting, [1, 1], [0.3, -2.0])
    for member, name in zip(old.members, ["controller", "grid"]):
        state = member.slave.getFMUstate()
        (tmp_path / name).write_bytes(member.slave.serializeFMUstate(state))
        member.slave.freeFMUstate(state)
    expected = b"".join(b"".join(values) for values in run(old, 2.0, [], 1.0))
    child = [sys.executable, "-c", CHILD, tmp_path, folders["controller"], folders["grid"]]
    subprocess.run(child, check=True, cwd=pathlib.Path(__file__).parent)
    assert (tmp_path / "trace").read_bytes() == expected


@pytest.mark.parametrize("which", ["controller", "grid"])
def test_damaged_states_are_refused(make, which):
    fmu = make(which)
    fmu.initialize()
    state = fmu.slave.getFMUstate()
    good = fmu.slave.serializeFMUstate(state)
    fmu.slave.freeFMUstate(state)
    before = fmu.everything()
    flipped = bytearray(good)
    flipped[len(good) // 2] ^= 0x10
    stranger = make({"controller": "grid", "grid": "controller"}[which])
    stranger.initialize()
    other = stranger.slave.getFMUstate()
    foreign = stranger.slave.serializeFMUstate(other)
    stranger.slave.freeFMUstate(other)
    for bad in [good[:-1], good[: len(good) // 2], good[:3], b"\0" * len(good), good + b"\0", bytes(flipped), foreign]:
        with pytest.raises(FMICallException):
            fmu.slave.deSerializeFMUstate(bad)
        assert fmu.everything() == before
    fmu.step(0.0, STEP)


def test_a_path_with_spaces_and_other_letters(archives, tmp_path):
    for which, archive in archives.items():
        folder = tmp_path / "a b %41 #1 Käfig 電池" / which
        fmpy.extract(archive, folder)
        with Fmu(folder, which) as fmu:
            fmu.initialize()
            fmu.step(0.0, STEP)


def test_without_its_resources_it_says_what_is_missing(folders, tmp_path):
    for which, folder in folders.items():
        broken = tmp_path / which
        shutil.copytree(folder, broken)
        shutil.rmtree(broken / "resources")
        refuses_to_start(lambda: Fmu(broken, which), "resources")


def refuses_to_start(start, word):
    import fmus

    mark = len(fmus.LOG)
    with pytest.raises(Exception, match="Failed to instantiate"):
        start()
    lines = [message for _, _, _, message in fmus.LOG[mark:]]
    assert any(word in line for line in lines), lines


def test_a_wrong_guid_is_refused(folders):
    for which, folder in folders.items():
        refuses_to_start(lambda: Fmu(folder, which, guid="00000000-0000-0000-0000-000000000000"), "00000000-0000")


def test_many_lives_leave_no_memory_behind(folders):
    def lives(count):
        for _ in range(count):
            for which, folder in folders.items():
                with Fmu(folder, which) as fmu:
                    fmu.initialize()
                    fmu.step(0.0, STEP)
        return resident_bytes()

    first = lives(50)
    count = 300
    grown = lives(count) - first
    # Less than one page a life: what an instance holds, its state alone, is more.
    assert grown < count * 4096, f"{grown / count:.0f} bytes more for each instance of both"


def resident_bytes():
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * 4096


def test_time_that_is_summed_up_is_understood(grid):
    grid.initialize()
    time = 0.0
    for _ in range(3000):
        grid.step(time, 0.1)
        time += 0.1  # off by 3e-10 in the end
    assert np.isfinite(grid.get("P")).all()
