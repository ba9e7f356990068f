"""Federates, brokers and runners that die: who goes on, who ends, what is left."""

import os
import signal

import pytest
from conftest import federate, free_port, kill, processes, reached, rows, until

# Case 1 without the exchange, which alone takes a quarter of a minute to settle; enabled from the start.
CASE = ("case1", "--set", "step_s=0.04", "--set", "control.gains.E=0", "--set", 'initial={"controller.enable":true}')
LOADS = ("--set", 'events=[{"at_s":50,"label":"load","set":{"grid.dP_load[12]":-0.5}}]')
RUN = ("federate", *CASE, "--set", "events=[]", "-o", "out", "-q", "--no-report")


def nobody_is_left(folder):
    until(lambda: not processes(folder), 25, "end of all processes")


@pytest.fixture
def frozen():
    """`frozen(number)` stops a process; it goes on when the test ends, or with SIGCONT."""
    stopped = []

    def stop(number):
        os.kill(number, signal.SIGSTOP)
        stopped.append(number)

    yield stop
    for number in stopped:
        try:
            os.kill(number, signal.SIGCONT)
        except ProcessLookupError:
            pass


def test_a_cluster_dies_at_40_s_and_is_back_at_70(start, frozen, tmp_path):
    """The others go on, with its agents taken out; it comes back from its checkpoint, without a bump, and joins in."""
    port = free_port()
    case = (*CASE, *LOADS)
    running = start(
        *("federate", *case, "-o", "out", "-q", "--no-report", "--port", port, "--checkpoint", "1s"),
    )
    grid = federate(tmp_path, "grid")
    seen = tmp_path / "out/grid/trajectory.csv.part"
    until(lambda: reached(seen) >= 39, 90, "40 s")
    kill(federate(tmp_path, "cluster2"))
    killed = reached(seen)
    # The others go on although it is gone, beyond the load step at 50 s.
    until(lambda: reached(seen) >= 68, 90, "life without it")
    frozen(grid)
    assert "cluster2 has died (signal 9); the others go on" in running.text()
    assert reached(tmp_path / "out/cluster1/trajectory.csv.part") >= 66
    back = start(
        *("federate", *case, "--federate", "cluster2", "--broker", f"127.0.0.1:{port}"),
        *("-o", "out/cluster2", "--checkpoint", "1s", "--resume"),
    )
    os.kill(grid, signal.SIGCONT)
    assert back.wait(90) == 0, back.text()
    assert running.wait(90) == 0, running.text()

    said = running.text()
    silent = float(said.split("grid: warning: cluster2 fell silent at t = ")[1].split(" ")[0])
    returned = float(said.split("cluster2 is back at t = ")[1].split(" ")[0])
    print(f"silent at {silent} s, back at {returned} s")
    assert 38.9 <= silent < killed + 6 and 68 <= returned < 90
    # Both, grid and the other cluster, have seen it go.
    assert "cluster1: warning: cluster2 fell silent at t = " in said

    names, values = rows(tmp_path / "out/trajectory.csv")
    steps = {round(row[0] / 0.04): dict(zip(names, row)) for row in values}
    assert sorted(steps) == list(range(3001))
    gone, here = round(silent / 0.04), round(returned / 0.04)
    theirs, others = range(4, 8), range(1, 4)

    def settled(step, agents):
        """Largest difference of K_P P among these agents, and of their frequencies from 1."""
        shares = [K_P[i - 1] * steps[step][f"grid.P[{i}]"] for i in agents]
        return max(shares) - min(shares), max(abs(steps[step][f"grid.omega[{i}]"] - 1) for i in agents)

    # While it is away it holds its setpoints, whatever the load does, and those who are left agree among each other.
    for i in theirs:
        held = {steps[k][f"controller.omega_set[{i}]"] for k in range(gone + 1, here - 1)}
        assert len(held) == 1, f"omega_set[{i}] moved while its controller was dead"
    spread, _ = settled(here - 2, others)
    assert spread < 1e-5
    # It comes back without a bump: no setpoint moves in a step by more than the law's largest rate (0.1 pu/s) allows.
    for i in range(1, 8):
        for k in range(here - 2, here + 10):
            moved = steps[k + 1][f"controller.omega_set[{i}]"] - steps[k][f"controller.omega_set[{i}]"]
            assert abs(moved) <= 0.1 * 0.04
    # And then all seven agree as if nothing had been.
    spread, error = settled(3000, range(1, 8))
    assert spread < 1e-5 and error < 1e-5, (spread, error)
    nobody_is_left(tmp_path)


K_P = [0.004, 0.0048, 0.005, 0.0036, 0.0038, 0.00408, 0.0044]


def test_without_a_comeback_the_others_reach_the_end(start, tmp_path):
    # What an earlier run has left counts for nothing.
    earlier = tmp_path / "out/cluster1/trajectory.csv"
    earlier.parent.mkdir(parents=True)
    earlier.write_text("time,cluster1.omega_set[1]\n0,9\n60,9\n")
    running = start(*RUN, "--set", "stop_s=60")
    until(lambda: reached(tmp_path / "out/grid/trajectory.csv.part") >= 1, 60, "start")
    kill(federate(tmp_path, "cluster1"))
    assert running.wait(90) == 3, running.text()
    assert "cluster1 ended early (signal 9); the others went on to the end" in running.text()
    names, values = rows(tmp_path / "out/trajectory.csv")
    assert values[-1][0] == 60
    # Its columns are what it told last.
    column = names.index("controller.omega_set[1]")
    assert values[-1][column] == values[-100][column]
    nobody_is_left(tmp_path)


def test_the_broker_dies(start, tmp_path):
    running = start(*RUN)
    until(lambda: reached(tmp_path / "out/grid/trajectory.csv.part") >= 1, 60, "start")
    broker = next(number for number, words in processes(tmp_path).items() if words[0] == "serve-broker")
    kill(broker)
    assert running.wait(60) == 3, running.text()
    for name in ("grid", "cluster1", "cluster2"):
        assert f"{name} ended at t = " in running.text()
        assert reached(tmp_path / f"out/{name}/trajectory.csv.part") >= 1
    assert "the broker has died (signal 9)" in running.text()
    # What there is has been put together.
    assert (tmp_path / "out/summary.json").is_file()
    nobody_is_left(tmp_path)


def test_the_broker_of_federates_started_by_hand_dies(start, tmp_path):
    """Nobody watches over these but HELICS itself."""
    port = free_port()
    broker = start("serve-broker", "zmq", "by_hand", f"-f3 --dynamic --port={port} --loglevel=error", prefix=ALIVE)
    broker_at = ("--broker", f"127.0.0.1:{port}")
    names = ("grid", "cluster1", "cluster2")
    all_of_them = [start("federate", *CASE, "--federate", name, *broker_at, "-o", name) for name in names]
    until(lambda: reached(tmp_path / "grid/trajectory.csv.part") >= 1, 60, "start")
    for number, words in processes(tmp_path).items():
        if words[0] == "serve-broker":
            kill(number)
    broker.wait()
    for name, one in zip(names, all_of_them):
        assert one.wait(40) == 1
        assert f"{name} ended at t = " in one.text() and "broker" in one.text(), one.text()
        assert reached(tmp_path / f"{name}/trajectory.csv.part") >= 1
    nobody_is_left(tmp_path)


PATIENCE = ("--patience", "2s")
# Patience, the time to answer, and what it takes to be taken out on a busy machine.
NOTICED = 2 + 5 + 20


def test_a_federate_started_by_hand_dies(start, tmp_path):
    """Nobody's child: the others ask for it, the grid takes it out, and all go on."""
    port = free_port()
    here = start(*RUN, "--set", "stop_s=40", "--without", "cluster2", "--port", port, *PATIENCE)
    until(lambda: "waiting for cluster2" in here.text(), 30, "broker")
    there = start(
        *("federate", *CASE, "--set", "events=[]", "--set", "stop_s=40", "--federate", "cluster2"),
        *("--broker", f"127.0.0.1:{port}", "-o", "there", *PATIENCE),
    )
    seen = tmp_path / "out/grid/trajectory.csv.part"
    until(lambda: reached(seen) >= 10, 60, "10 s")
    kill(there.process.pid)
    killed = reached(seen)
    assert killed < 35, "it was over before anybody died"
    until(lambda: not seen.exists() or reached(seen) > killed + 2, NOTICED, "life without it")
    assert here.wait(60) == 3, here.text()
    said = here.text()
    assert "grid: cluster2: no answer, " in said and "cluster2 was taken out, the others go on" in said
    for name in ("grid", "cluster1"):
        silent = float(said.split(f"{name}: warning: cluster2 fell silent at t = ")[1].split(" ")[0])
        assert killed - 1 <= silent <= killed + 6, (name, silent, killed)
    assert "cluster2 ended early (it fell silent); the others went on to the end" in said
    _, values = rows(tmp_path / "out/trajectory.csv")
    assert values[-1][0] == 40
    nobody_is_left(tmp_path)


@pytest.mark.parametrize("dead", ["cluster1", "grid"])
def test_one_of_federates_all_started_by_hand_dies(start, tmp_path, dead):
    port = free_port()
    broker = start("serve-broker", "tcp", "by_hand", f"-f3 --dynamic --port={port} --loglevel=error", prefix=ALIVE)
    words = ("--broker", f"127.0.0.1:{port}", "--core", "tcp", "--set", "stop_s=40", "--set", "events=[]", *PATIENCE)
    ones = {
        name: start("federate", *CASE, *words, "--federate", name, "-o", name)
        for name in ("grid", "cluster1", "cluster2")
    }
    seen = tmp_path / "cluster2/trajectory.csv.part"
    until(lambda: reached(seen) >= 10, 60, "10 s")
    kill(ones.pop(dead).process.pid)
    killed = reached(seen)
    if dead == "grid":
        for name, one in ones.items():
            assert one.wait(NOTICED) == 1
            assert "grid: no answer, " in one.text() and "without grid there is nothing to measure" in one.text()
            assert reached(tmp_path / f"{name}/trajectory.csv.part") >= 10
    else:
        until(lambda: not seen.exists() or reached(seen) > killed + 2, NOTICED, "life without it")
        for name, one in ones.items():
            assert one.wait(60) == 3, one.text()
            assert f"cluster1 fell silent and did not come back; {name} went on to the end" in one.text()
            assert rows(tmp_path / name / "trajectory.csv")[1][-1][0] == 40
        assert "cluster1 was taken out" in ones["grid"].text()
    for number, said in processes(tmp_path).items():
        if said[0] == "serve-broker":
            kill(number)
    broker.wait()
    nobody_is_left(tmp_path)


# A broker ends with the process that started it; this one stays until it is killed.
ALIVE = ("/bin/sh", "-c", 'tail -f /dev/null | "$@"', "sh")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_the_runner_dies(start, tmp_path, number):
    running = start(*RUN)
    until(lambda: reached(tmp_path / "out/grid/trajectory.csv.part") >= 1, 60, "start")
    os.kill(running.process.pid, number)
    running.wait(10)
    nobody_is_left(tmp_path)
    assert reached(tmp_path / "out/grid/trajectory.csv.part") >= 1


def test_the_grid_dies(start, tmp_path):
    running = start(*RUN)
    until(lambda: reached(tmp_path / "out/grid/trajectory.csv.part") >= 1, 60, "start")
    kill(federate(tmp_path, "grid"))
    assert running.wait(60) == 3
    assert "grid has died (signal 9)" in running.text()
    nobody_is_left(tmp_path)
