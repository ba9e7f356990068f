"""Controller and grid, coupled in an FMPy loop: the closed loop of Case 1."""

import subprocess
import sys

import numpy as np
from fmus import Pair

STEP = 0.01
SHORT_CASE1 = [(2.0, 0, "enable", True), (22.0, 1, "dP_load[12]", -0.5), (22.0, 1, "dQ_load[12]", -0.5)]


def couple(make, parameters, stop, schedule, step=STEP, observe=None):
    pair = Pair(make("controller"), make("grid")).initialize((parameters, {}))
    pair.run(stop, step, schedule, observe and (lambda time: observe(time, *pair.members)))
    return pair.members


def test_frequency_is_restored_and_power_is_shared(make):
    seen = {}

    def observe(time, controller, grid):
        if round(time / STEP) in (199, 2199):
            seen[round(time)] = grid.get("omega"), controller.get("K_P") * grid.get("P")

    controller, grid = couple(make, {"gain_E": 0.0}, 50.0, SHORT_CASE1, observe=observe)
    # Before: droop alone lets the frequency sag, and unequal setpoints spoil the sharing.
    omega, shares = seen[2]
    assert np.abs(omega - 1).max() > 1e-3 and np.ptp(shares) > 1e-3
    # Activated, and again after the load step: restored and shared.
    for omega, shares in [seen[22], (grid.get("omega"), controller.get("K_P") * grid.get("P"))]:
        assert np.abs(omega - 1).max() < 1e-9
        assert np.ptp(shares) < 1e-9
    assert controller.get("error_omega") < 1e-9
    assert controller.get("spread_P") < 1e-9
    assert (grid.get("P") > 0).all()


def test_the_average_voltage_is_restored_and_reactive_power_shared(make):
    controller, grid = couple(make, {"gain_E": 0.0, "voltage_policy": 1}, 50.0, SHORT_CASE1)
    assert abs(grid.get("V").mean() - 1) < 1e-9
    assert np.ptp(controller.get("K_Q") * grid.get("Q")) < 1e-9


def test_a_step_of_100_ms_does_not_shake_the_loop(make):
    """Explicit Euler would chatter at 4e-2 here, and a cap that forgets this master's lag at 2e-1."""
    controller, grid = couple(make, {"gain_E": 0.0}, 100.0, SHORT_CASE1, step=0.1)
    assert np.abs(grid.get("omega") - 1).max() < 1e-7
    assert np.ptp(controller.get("K_P") * grid.get("P")) < 1e-7


def test_energy_is_balanced_beside_the_sharing_and_none_is_made(make):
    """Every exchange sums to zero; within 100 s the states of charge meet, and K_P P stays shared."""
    sums, spreads = [], []

    def observe(_, controller, grid):
        sums.append(controller.get("P_set").sum())
        spreads.append(np.ptp(grid.get("E") / controller.get("capacity")))

    controller, grid = couple(make, {}, 102.0, [(2.0, 0, "enable", True)], observe=observe)
    assert np.abs(sums).max() < 1e-12
    assert spreads[0] > 5e-3 and spreads[-1] < 2e-4
    sharing = controller.get("K_P") * (grid.get("P") - controller.get("P_set"))
    assert np.ptp(sharing) < 1e-5


def test_the_same_steady_states_as_in_the_harness(make, bess, root, tmp_path):
    """The whole of Case 1, driven by the inputs that `bess run` wrote down. Without the energy exchange, which
    is still under way when the loads step and shows the FMPy loop's lag."""
    archives = ["--controller", "fmu/BessConsensus.fmu", "--grid", "fmu/BessGrid.fmu"]
    command = [bess, "run", "case1", "--no-report", "--set", "control.gains.E=0", "-o", tmp_path, *archives]
    subprocess.run(command, cwd=root, check=True, stdout=sys.stderr)
    with open(tmp_path / "trajectory.csv") as file:
        header = file.readline().strip().split(",")
        table = np.loadtxt(file, delimiter=",")
    time, columns = table[:, 0], dict(zip(header, table.T))
    assert header[0] == "time" and abs(time[-1] - 120.0) < 1e-9

    pair = Pair(make("controller"), make("grid"))
    members = dict(zip(["controller", "grid"], pair.members))
    schedule, changes = schedule_of(columns, members, time)
    # Enabled once, and two load steps.
    assert len(changes) >= 3, f"{changes}: the events' inputs are columns of the trajectory"

    compared = [k - 1 for k in changes] + [len(time) - 1]
    quantities = [("grid", q) for q in ["P", "Q", "V", "omega"]]
    quantities += [("controller", q) for q in ["omega_set", "V_set", "P_set"]]
    names = [f"{who}.{name}" for who, q in quantities for name in members[who].arrays[q]]
    found = {}

    def observe(now):
        if round(now / STEP) in at:
            values = [members[who].get(q) for who, q in quantities]
            found[at[round(now / STEP)]] = np.concatenate(values)

    at = {round(time[k] / STEP): k for k in compared}
    pair.initialize(({"gain_E": 0.0}, {})).run(120.0, STEP, schedule, observe)
    assert sorted(found) == compared
    for k, values in found.items():
        deviation = np.abs(values - [columns[name][k] for name in names])
        worst = deviation.argmax()
        assert deviation[worst] < 1e-6, f"{names[worst]} at t = {time[k]}: {deviation[worst]:.2e}"


def schedule_of(columns, members, time):
    """The changes of all inputs that stand in the trajectory, and the rows at which something changed."""
    schedule, rows = [], set()
    for index, (who, member) in enumerate(members.items()):
        for name in member.of_causality("input"):
            values = columns.get(f"{who}.{name}")
            connected = any(f"{other}.{name}" in columns for other in members if other != who)
            if values is None or connected:
                continue
            schedule.append((time[0], index, name, values[0]))
            for k in np.flatnonzero(np.diff(values)) + 1:
                schedule.append((time[k], index, name, values[k]))
                rows.add(int(k))
    return schedule, sorted(rows)


def test_the_example_runs_as_printed(root):
    script = root / "examples/couple_fmpy.py"
    command = [sys.executable, script, "--stop", "18", "--enable-at", "2", "--load-at", "8", "--no-plot"]
    # Started from somewhere else: it finds the FMUs by itself.
    result = subprocess.run(command, cwd="/", capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    rows = [line.split() for line in result.stdout.splitlines() if line[:6].strip()[:1].isdigit()]
    assert len(rows) >= 4
    last = rows[-1]
    assert abs(float(last[0]) - 18.0) < 1e-9
    assert abs(float(last[1])) < 1e-5, "frequency is restored (droop alone: 7e-3)"


def test_the_harness_gives_equal_columns_with_and_without_fmus(bess, root, tmp_path):
    """The same loop over the C interface and in process, to the last bit of every column."""
    archives = ["--controller", "fmu/BessConsensus.fmu", "--grid", "fmu/BessGrid.fmu"]
    tables = []
    for folder, options in [("fmus", archives), ("in_process", [])]:
        command = [bess, "run", "case1", "--no-report", "--quiet", "-o", tmp_path / folder, *options]
        subprocess.run(command, cwd=root, check=True)
        tables.append((tmp_path / folder / "trajectory.csv").read_bytes())
    assert tables[0].count(b"\n") == 12002
    assert tables[0] == tables[1]
