"""A federation gives, bit for bit, what one process gives."""

import json
import subprocess
import sys

import pytest
from conftest import ENVIRONMENT, PROGRAM, free_port

# Events off the grid of communication steps, so that steps are cut, and one at the very start.
OFF_GRID = {
    "extends": "case1",
    "name": "off_grid",
    "step_s": 0.03,
    "stop_s": 4.0,
    "compare": [],
    "events": [
        {"at_s": 0.0, "label": "on", "set": {"controller.enable": True}},
        {"at_s": 1.0, "label": "load", "set": {"grid.dP_load[12]": -0.5}},
        {"at_s": 2.2345, "label": "load", "set": {"grid.dP_load[8]": 1.0, "controller.P_ref": 0.0}},
    ],
}
SHORT = ("--set", "stop_s=3", "--set", 'events=[{"at_s":1,"label":"on","set":{"controller.enable":true}}]')


def test_every_core_gives_the_bits_of_one_process(bess, tmp_path):
    for parts in ("whole", "clusters"):
        cut = () if parts == "whole" else ("--parts", parts)
        bess("run", "case1", *SHORT, *cut, "-o", "one", "-q", "--no-report")
        one = (tmp_path / "one/trajectory.csv").read_bytes()
        for core in ("zmq", "tcp", "ipc"):
            bess("federate", "case1", *SHORT, "--parts", parts, "--core", core, "-o", core, "-q", "--no-report")
            assert (tmp_path / core / "trajectory.csv").read_bytes() == one, (parts, core)


def test_so_does_a_federate_for_each_battery(bess, tmp_path):
    bess("run", "case1", *SHORT, "--parts", "agents", "-o", "one", "-q", "--no-report")
    bess("federate", "case1", *SHORT, "--parts", "agents", "-o", "two", "-q", "--no-report")
    assert (tmp_path / "two/trajectory.csv").read_bytes() == (tmp_path / "one/trajectory.csv").read_bytes()


@pytest.mark.parametrize("publish", ["doubles", "packed"])
def test_so_does_every_way_to_publish(bess, tmp_path, publish):
    bess("run", "case1", *SHORT, "--parts", "clusters", "-o", "one", "-q", "--no-report")
    bess("federate", "case1", *SHORT, "--publish", publish, "-o", "two", "-q", "--no-report")
    assert (tmp_path / "two/trajectory.csv").read_bytes() == (tmp_path / "one/trajectory.csv").read_bytes()


def test_steps_that_events_cut(bess, tmp_path):
    (tmp_path / "scenario.json").write_text(json.dumps(OFF_GRID))
    bess("run", "scenario.json", "--parts", "clusters", "-o", "one", "-q")
    bess("federate", "scenario.json", "-o", "two", "-q")
    assert (tmp_path / "two/trajectory.csv").read_bytes() == (tmp_path / "one/trajectory.csv").read_bytes()
    # The same figures, but for times on the clock.
    one, two = (json.loads((tmp_path / run / "summary.json").read_text()) for run in ("one", "two"))
    for summary in (one, two):
        del summary["wall_s"], summary["real_time_factor"]
    assert two == one
    assert (tmp_path / "two/report.html").is_file()


def test_faults_on_the_wire(bess, tmp_path):
    """Wherever a battery's controller runs, its measurements are as wrong as in one process."""
    faults = [
        {"kind": "noise", "signal": "P[{i}]", "deviation": 1e-3, "seed": 5},
        {"kind": "stuck", "signal": "omega[6]", "value": 1.001, "from_s": 1.5, "until_s": 2},
        {"kind": "nan", "signal": "Q[5]", "from_s": 2, "until_s": 2.5},
        {"kind": "drift", "signal": "grid.V_set[2]", "rate_per_s": 1e-4, "from_s": 2.5},
    ]
    wrong = ("--set", f"faults={json.dumps(faults)}")
    bess("run", "case1", *SHORT, "--parts", "clusters", "-o", "sound", "-q", "--no-report")
    for parts in ("clusters", "agents"):
        bess("run", "case1", *SHORT, *wrong, "--parts", parts, "-o", "one", "-q", "--no-report")
        said = bess("federate", "case1", *SHORT, *wrong, "--parts", parts, "-o", "two", "-q", "--no-report")
        lost = "cluster2.Q[2]" if parts == "clusters" else "agent5.Q[1]"
        assert f"{lost} was not a finite number from 2.0 s to 2.5 s" in said
        one = (tmp_path / "one/trajectory.csv").read_bytes()
        assert (tmp_path / "two/trajectory.csv").read_bytes() == one, parts
        assert one != (tmp_path / "sound/trajectory.csv").read_bytes()
        one, two = (json.loads((tmp_path / run / "summary.json").read_text()) for run in ("one", "two"))
        assert two["faults"] == one["faults"]


def test_fmus_in_both_places(bess, tmp_path):
    for part, file in (("controller", "C.fmu"), ("grid", "G.fmu")):
        bess("export", part, "case1", "-o", file)
    fmus = ("--controller", "C.fmu", "--grid", "G.fmu")
    bess("run", "case1", *SHORT, *fmus, "-o", "one", "-q", "--no-report")
    bess("federate", "case1", *SHORT, *fmus, "-o", "two", "-q", "--no-report")
    assert (tmp_path / "two/trajectory.csv").read_bytes() == (tmp_path / "one/trajectory.csv").read_bytes()


def test_helics_run_starts_it_too(bess, start, tmp_path):
    bess("run", "case1", *SHORT, "--parts", "clusters", "-o", "one", "-q", "--no-report")
    port = free_port()
    bess("federate", "case1", *SHORT, "--port", port, "-o", "two", "-q", "--no-report")
    file = json.loads((tmp_path / "two/helics_runner.json").read_text())
    assert sorted(entry["name"] for entry in file["federates"])[0] == "broker"
    for folder in (tmp_path / "two").iterdir():
        if folder.is_dir():
            (folder / "trajectory.csv").unlink()
    # It logs beside the file and runs the commands where the file is.
    runner = tmp_path / "helics_runner.json"
    (tmp_path / "two/helics_runner.json").rename(runner)
    command = [sys.executable, "-m", "helics.cli", "run", f"--path={runner}"]
    done = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    header, *lines = (tmp_path / "two/grid/trajectory.csv").read_text().splitlines()
    whole, *expected = (tmp_path / "one/trajectory.csv").read_text().splitlines()
    column, source = header.split(",").index("grid.P[1]"), whole.split(",").index("grid.P[1]")
    assert [line.split(",")[column] for line in lines] == [line.split(",")[source] for line in expected]


def test_what_is_published_can_be_asked_for(bess):
    text = bess("federate", "case1", "--topics", "--publish", "doubles")
    assert "grid/P/1 double pu cluster1/from/grid/P/1 P[1]" in text


def test_a_missing_library_is_named_with_what_brings_it(tmp_path):
    environment = {**ENVIRONMENT, "PATH": "/nonexistent"}
    command = [PROGRAM, "federate", "case1"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=30)
    said = " ".join(done.stderr.replace("\u2502", " ").split())
    assert done.returncode == 1 and "pip install helics==3.6.1" in said and "--helics" in said, said
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--federate", "cluster3"), 'no federate "cluster3"'),
        (("--set", "master=gauss_seidel"), "set master to"),
        (("--federate", "grid", "--broker", "127.0.0.1:x"), "HOST:PORT"),
        (("--without", "nobody"), 'no federate "nobody"'),
    ],
)
def test_what_does_not_fit_is_refused_before_anything_starts(bess, tmp_path, arguments, said):
    assert said in bess("federate", "case1", *arguments, code=2)
    assert [path.name for path in tmp_path.iterdir() if not path.name.startswith("said")] == []


def test_a_broker_that_is_not_there(bess):
    broker = f"127.0.0.1:{free_port()}"
    said = bess("federate", "case1", "--federate", "grid", "--broker", broker, "--wait", "2s", code=1)
    assert "is the broker running" in said
