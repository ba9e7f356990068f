"""Federates, brokers and runners that die: who goes on, who ends, what is left."""

import os
import signal

import pytest
from conftest import federate, free_port, kill, processes, reached, rows, until

# Slow enough to be caught in the middle, whatever the machine: thousands of steps a second are not to be had.
SLOW = ("--set", "step_s=0.002", "--set", "stop_s=30", "--set", 'initial={"controller.enable":true}', "--set", "events=[]")
RUN = ("federate", "case1", *SLOW, "-o", "out", "-q", "--no-report")


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


def test_a_controller_dies_and_comes_back(start, frozen, tmp_path):
    """Killed on its way; the grid goes on with its last setpoints; it comes back from its checkpoint without a bump."""
    port = free_port()
    running = start(*RUN, "--port", port, "--checkpoint", "100ms")
    grid = federate(tmp_path, "grid")
    seen = tmp_path / "out/grid/trajectory.csv.part"
    until(lambda: reached(seen) >= 3, 60, "start")
    kill(federate(tmp_path, "controller"))
    killed = reached(seen)
    # The others go on although it is gone.
    until(lambda: reached(seen) >= killed + 3, 60, "life without it")
    frozen(grid)
    assert "controller has died (signal 9); the others go on" in running.text()
    back = start(
        *("federate", "case1", *SLOW, "--federate", "controller", "--broker", f"127.0.0.1:{port}"),
        *("-o", "out/controller", "--checkpoint", "100ms", "--resume"),
    )
    os.kill(grid, signal.SIGCONT)
    assert back.wait(120) == 0, back.text()
    assert running.wait(120) == 0, running.text()
    said = running.text()
    assert "controller fell silent at t = " in said and "controller is back at t = " in said
    silent = float(said.split("fell silent at t = ")[1].split(" ")[0])
    returned = float(said.split("is back at t = ")[1].split(" ")[0])
    assert 2.9 <= silent < killed + 1.5 and returned >= killed + 2
    names, values = rows(tmp_path / "out/trajectory.csv")
    assert [round(row[0] / 0.002) for row in values] == list(range(15001))
    own = [names.index(f"controller.omega_set[{i}]") for i in range(1, 8)]
    at = {round(row[0] / 0.002): [row[k] for k in own] for row in values}
    gone, here = round(silent / 0.002), round(returned / 0.002)
    # What the controller holds when it comes back is what its checkpoint held, a tenth of a second before its end.
    assert at[here] == at[here - 1]
    ages = [k for k in range(gone - 100, gone + 1) if at[k] == at[here]]
    assert ages, "it came back with setpoints that it never had"
    # And then it works again: frequency and sharing are those of a run that nobody disturbed.
    last = dict(zip(names, values[-1]))
    assert max(abs(last[f"grid.omega[{i}]"] - 1) for i in range(1, 8)) < 1e-5
    nobody_is_left(tmp_path)


def test_without_a_comeback_the_others_reach_the_end(start, tmp_path):
    running = start("federate", "case1", "--set", "stop_s=60", "-o", "out", "-q", "--no-report")
    until(lambda: reached(tmp_path / "out/grid/trajectory.csv.part") >= 1, 60, "start")
    kill(federate(tmp_path, "controller"))
    assert running.wait(90) == 3, running.text()
    assert "controller ended early (signal 9); the others went on to the end" in running.text()
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
    for name in ("grid", "controller"):
        assert f"{name} ended at t = " in running.text()
        assert reached(tmp_path / f"out/{name}/trajectory.csv.part") >= 1
    assert "the broker has died (signal 9)" in running.text()
    # What there is has been put together.
    assert (tmp_path / "out/summary.json").is_file()
    nobody_is_left(tmp_path)


def test_the_broker_of_federates_started_by_hand_dies(start, tmp_path):
    """Nobody watches over these but HELICS itself."""
    port = free_port()
    broker = start("serve-broker", "zmq", "by_hand", f"-f2 --dynamic --port={port} --loglevel=error", prefix=ALIVE)
    broker_at = ("--broker", f"127.0.0.1:{port}")
    both = [
        start("federate", "case1", *SLOW, "--federate", name, *broker_at, "-o", name) for name in ("grid", "controller")
    ]
    until(lambda: reached(tmp_path / "grid/trajectory.csv.part") >= 1, 60, "start")
    for number, words in processes(tmp_path).items():
        if words[0] == "serve-broker":
            kill(number)
    broker.wait()
    for name, one in zip(("grid", "controller"), both):
        assert one.wait(40) == 1
        assert f"{name} ended at t = " in one.text() and "broker" in one.text(), one.text()
        assert reached(tmp_path / f"{name}/trajectory.csv.part") >= 1
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
