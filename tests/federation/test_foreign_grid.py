"""A federate that is none of ours in the grid's place."""

import json
import pathlib
import subprocess
import sys

from conftest import ENVIRONMENT, free_port, rows, until

HERE = pathlib.Path(__file__).parent


def test_a_plain_python_federate_takes_the_grids_place(start, bess, tmp_path):
    port, step, steps = free_port(), 0.02, 500
    names = sorted({line.split("/")[0] for line in topics(bess) if not line.startswith("grid/")})
    scenario = ("case1", "--set", f"stop_s={step * steps}", "--set", f"step_s={step}", "--set", "control.gains.E=0", "--set", "events=[]")
    on = ("--set", 'initial={"controller.enable":true}')
    running = start("federate", *scenario, *on, "--without", "grid", "--port", port, "-o", "out", "-q")
    until(lambda: "waiting for grid" in running.text(), 20, "broker")
    script = [sys.executable, HERE / "copper_plate.py", f"127.0.0.1:{port}", str(step), str(steps), ",".join(names)]
    grid = subprocess.run(script, env=ENVIRONMENT, capture_output=True, text=True, timeout=90)
    assert grid.returncode == 0, grid.stderr
    assert running.wait() == 0, running.text()
    last = json.loads(grid.stdout)
    # What the law promises: nominal frequency, and the load shared by the droops.
    assert abs(last["omega"] - 1) < 1e-6
    share = 3.0 / sum(1 / k for k in last["K_P"])
    shares = [k * p for k, p in zip(last["K_P"], last["P"])]
    assert max(abs(value - share) for value in shares) < 1e-6
    # And what it told stands in the merged trajectory under the grid's name.
    names, values = rows(tmp_path / "out/trajectory.csv")
    final = dict(zip(names, values[-1]))
    assert [final[f"grid.P[{i}]"] for i in range(1, 8)] == last["P"]
    assert final["grid.omega[1]"] == last["omega"] and final["time"] == step * steps


def topics(bess):
    text = bess("federate", "case1", "--topics")
    return [word for word in text.split() if word.count("/") == 2 and "/from/" not in word]
