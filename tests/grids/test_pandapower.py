"""pandapower's case57, made into an FMU by PythonFMU here and now, under the controller: once in a loop of FMPy, once
by `bess run` with a connection table. Two masters, one system: they must see the same run.
"""

import csv
import json
import os
import shutil
import subprocess
import sysconfig

import fmpy
import numpy
import pytest
from fmus import Fmu
from loop import SETTLED, Controller, Record

BUSES = [1, 2, 3, 6, 8, 9, 12]
SHARES = numpy.array([1.0, 1.2, 1.25, 0.9, 0.95, 1.02, 1.1])
K_P, CAPACITY = 0.004 * SHARES, 0.5 / SHARES
MVA, KV, HZ = 100.0, 115.0, 60.0
H = 0.02
ENABLE, LOAD, STOP = 2.0, 26.0, 50.0  # s, as in scenario.json


def names(quantity):
    return [f"bess_{bus}.{quantity}" for bus in BUSES]


def measure(grid):
    def get(quantity):
        return numpy.array(grid.get_all(names(quantity)))

    return {
        "P": get("P_MW") / MVA,
        "Q": get("Q_Mvar") / MVA,
        "V": get("v_kV") / KV,
        "omega": get("f_Hz") / HZ,
        "E": get("soc_percent") / 100 * CAPACITY,
    }


def command(grid, setpoints):
    grid.set_all(names("f_set_Hz"), setpoints["omega_set"] * HZ)
    grid.set_all(names("v_set_kV"), setpoints["V_set"] * KV)
    grid.set_all(names("P_ref_MW"), setpoints["P_set"] * MVA)
    grid.set_all(names("Q_ref_Mvar"), setpoints["Q_set"] * MVA)


@pytest.fixture(scope="module")
def in_fmpy(controller_fmu, pandapower_fmu, tmp_path_factory):
    """omega and K_P (P - P_set) over time, and the last measurements."""
    unpacked = fmpy.extract(pandapower_fmu, tmp_path_factory.mktemp("grid"))
    # PythonFMU lists no InitialUnknowns, which FMPy would mind.
    grid, controller = Fmu(unpacked, "grid", validate=False), Controller(controller_fmu)
    grid.setup()
    command(grid, controller.setpoints())
    grid.ready()
    controller.start(measure(grid))
    record = Record(K_P)
    for k in range(round(STOP / H) + 1):
        if k == round(ENABLE / H):
            controller.set("enable", True)
        if k == round(LOAD / H):
            grid.set_all(["load_12.dP_MW", "load_12.dQ_Mvar"], [-50.0, -50.0])
        setpoints = controller.setpoints()
        command(grid, setpoints)
        measured = measure(grid)
        record.add(k * H, measured, setpoints)
        controller.measure(measured)
        controller.step(k * H, H)
        grid.step(k * H, H)
    for slave in (grid, controller):
        slave.close()
    return record, measured


@pytest.fixture(scope="module", autouse=True)
def started(bess, pandapower_fmu, tmp_path_factory):
    """`bess run` with Case57.fmu and the connection table, on its way beside FMPy's loop; and its folder."""
    folder = tmp_path_factory.mktemp("run")
    shutil.copy(pandapower_fmu, folder)
    shutil.copy(os.path.join(os.path.dirname(__file__), "scenario.json"), folder)
    command = [bess, "run", "scenario.json", "-o", "out"]
    with subprocess.Popen(command, cwd=folder, env=environment(), stdin=subprocess.DEVNULL) as process:
        yield process, folder / "out"


@pytest.fixture(scope="module")
def by_bess(started):
    """Folder of the results, complete."""
    process, folder = started
    assert process.wait() == 0
    return folder


def environment():
    """PythonFMU's library leaves Python to its host: libpython is loaded first, and finds its packages here."""
    library = os.path.join(sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME"))
    return os.environ | {"LD_PRELOAD": library, "PYTHONPATH": sysconfig.get_path("purelib")}


def test_without_python_the_host_is_told_what_to_do(bess, pandapower_fmu, tmp_path):
    shutil.copy(pandapower_fmu, tmp_path)
    shutil.copy(os.path.join(os.path.dirname(__file__), "scenario.json"), tmp_path)
    bare = {name: value for name, value in os.environ.items() if name not in ("LD_PRELOAD", "PYTHONPATH")}
    done = subprocess.run([bess, "run", "scenario.json"], cwd=tmp_path, env=bare, capture_output=True, text=True)
    assert done.returncode == 2
    said = " ".join(word for word in done.stderr.split() if word != "│")
    assert "undefined symbol: _Py" in said and "LD_PRELOAD" in said, said


def test_frequency_and_sharing_settle_in_fmpy(in_fmpy):
    record, _ = in_fmpy
    _, shares = record.worst(0, ENABLE)
    assert shares > 1e-2, "droop alone shares in proportion already; the test shows nothing"
    for begin, end in ((LOAD - 5, LOAD - H), (STOP - 5, STOP)):
        omega, shares = record.worst(begin, end)
        print(f"{begin} to {end} s: omega {omega:.1e}, K_P (P - P_set) {shares:.1e}")
        assert omega < SETTLED and shares < SETTLED


def test_bess_run_says_that_it_settled(by_bess):
    phases = json.loads((by_bess / "summary.json").read_text())["phases"]
    assert [phase["from_s"] for phase in phases] == [0, ENABLE, LOAD]
    for phase in phases[1:]:
        print({key: phase[key] for key in ("omega_error", "p_spread", "omega_settled_s", "p_settled_s")})
        assert phase["omega_error"] < SETTLED and phase["p_spread"] < SETTLED


def test_both_masters_see_the_same_run(in_fmpy, by_bess):
    """Step by step, with two conversions of units: bess's table and the few lines above. They round differently, at
    1e-16; 1e-9 leaves room for what 2500 steps make of that and none for a factor, a sign or a step of delay.
    """
    record, measured = in_fmpy
    with open(by_bess / "trajectory.csv") as file:
        rows = csv.reader(file)
        header = next(rows)
        table = numpy.array([[float(value) for value in row] for row in rows])

    def grid(quantity):
        return table[:, [header.index(f"grid.{name}") for name in names(quantity)]]

    assert numpy.abs(table[:, 0] - record.time).max() < 1e-9
    apart = numpy.abs(grid("f_Hz") / HZ - record.omega).max()
    print(f"omega: {apart:.1e} pu apart at most")
    assert apart < 1e-9
    for quantity, base, other in (("P_MW", MVA, "P"), ("Q_Mvar", MVA, "Q"), ("v_kV", KV, "V")):
        apart = numpy.abs(grid(quantity)[-1] / base - measured[other]).max()
        print(f"{other}: {apart:.1e} pu apart in the end")
        assert apart < 1e-9 / K_P.min()
    assert numpy.abs(grid("soc_percent")[-1] / 100 * CAPACITY - measured["E"]).max() < 1e-9
