"""FMI 3.0: one FMU for any number of batteries and any graph, the same as an FMU exported for just that, bit for bit."""

import json
import xml.etree.ElementTree as ElementTree
import zipfile

import numpy as np
import pytest
from fmpy import simulate_fmu

from fmus3 import FMICallException, packed

MEASURED = ["P", "Q", "V", "omega", "E"]

# What case1.json says of its seven batteries.
K_P = [0.004, 0.0048, 0.005, 0.0036, 0.0038, 0.00408, 0.0044]
K_Q = [0.02, 0.0242, 0.026, 0.0246, 0.019, 0.0212, 0.0226]
OMEGA_SET = [1.0015, 0.999, 1.0005, 0.9985, 1.001, 0.9995, 1.0]
CONTROL = {"eta": 0.5, "gains": {"omega": 1, "P": 1, "E": 0.003, "V": 1, "Q": 1}}


def write(folder, n, edges, pins):
    """A scenario of n batteries without a grid, case1's over and over, with this graph."""
    bess = [
        {"bus": i + 1, "K_P": K_P[k], "K_Q": K_Q[k], "omega_set_start": OMEGA_SET[k], "soc_start": 0.7}
        for i, k in ((i, i % 7) for i in range(n))
    ]
    graph = {
        "name": "written",
        "edges": [{"a": a, "b": b, "weight": w} for a, b, w in edges],
        "pins": [{"agent": a, "weight": w} for a, w in pins],
    }
    scenario = {
        "name": f"of{n}",
        "stop_s": 120,
        "step_s": 0.01,
        "bess": bess,
        "control": CONTROL,
        "communication": {"graphs": [graph]},
        "grid": {"case": "none"},
    }
    file = folder / f"of{n}.json"
    file.write_text(json.dumps(scenario))
    return file


def ring(n):
    """What the FMU takes where n is not the file's and no edge is written."""
    return [(i, i % n + 1, 1.0) for i in range(1, n + 1 if n > 2 else n)]


def driven(fmu, n, steps=200):
    """All outputs at each of these steps, with measurements that scatter and agents that come and go."""
    random = np.random.default_rng(n)
    fmu.initialize({"enable": True})
    outputs = [name for name in ["omega_set", "V_set", "P_set", "Q_set", "u_omega", "u_P", "u_E", "u_V", "u_Q"]]
    outputs += ["spread_P", "spread_Q", "spread_E", "error_omega", "error_V", "lambda_2", "T_P", "T_omega"]
    outputs += ["cluster", "saturated"]
    for k in range(steps):
        for name, middle in zip(MEASURED, [1.0, 0.3, 1.0, 1.0, 0.3]):
            fmu.set(name, middle + 1e-2 * random.standard_normal(n))
        if k % 50 == 25:
            fmu.set("available", random.random(n) < 0.8)
            fmu.set("dispatch", k % 100 == 25)
        yield [packed(fmu.get(name)) for name in outputs]
        fmu.step(k * 0.01, 0.01)


def equal(one, other, n):
    """Whether two FMUs do the same, bit for bit, and something at all."""
    first = None
    for sample, expected in zip(driven(one, n), driven(other, n), strict=True):
        assert sample == expected
        first = first or sample
    assert first != sample


@pytest.mark.parametrize("n", [1, 2, 3, 12, 40])
def test_n_set_in_configuration_mode_is_an_fmu_exported_for_n(make2, make3, tmp_path, n):
    one = make3("controller")
    one.configure(n=n)
    equal(one, make2("controller", write(tmp_path, n, ring(n), [(1, 1.0)])), n)


def test_as_many_agents_as_in_the_file_change_nothing(make2, make3):
    one = make3("controller")
    one.configure(n=7)
    equal(one, make2("controller"), 7)


@pytest.mark.parametrize("n", [5, 7])
def test_a_graph_written_through_arrays_is_one_written_into_the_file(make2, make3, tmp_path, n):
    edges = [(1, 3, 0.5), (3, 2, 1.0), (5, 2, 0.25), (4, 5, 2.0), (1, 5, 1.5)] + [(4, 6, 1.0), (6, 7, 0.5)][: n - 5]
    pins = [(2, 0.5), (4, 1.5)]
    one = make3("controller")
    # Two rows too many stay zero, one of them in the middle.
    one.configure(n=n, n_edges=len(edges) + 2)
    rows = edges[:2] + [(0, 0, 0.0)] + edges[2:] + [(0, 0, 0.0)]
    for name, column in zip(["edge_from", "edge_to", "edge_weight"], zip(*rows)):
        one.set(name, column)
    one.set("pin_weight", [dict(pins).get(i, 0.0) for i in range(1, n + 1)])
    equal(one, make2("controller", write(tmp_path, n, edges, pins)), n)


def test_parameters_of_every_agent_can_be_set(make2, make3, tmp_path):
    n, values = 4, {"K_P": [0.01, 0.02, 0.03, 0.04], "V_set_start": [1.0, 1.01, 1.02, 1.03], "capacity": 0.5}
    one, other = make3("controller"), make2("controller", write(tmp_path, n, ring(n), [(1, 1.0)]))
    one.configure(n=n)
    for name, value in values.items():
        one.set(name, value)
        other.set(name, value)
    equal(one, other, n)


def test_scalars_set_before_stay_and_reset_gives_back_the_file(make3):
    fmu = make3("controller")
    before = fmu.everything()
    fmu.set("eta", 0.25)
    fmu.configure(n=3)
    assert fmu.get("eta") == 0.25
    fmu.initialize({"enable": True})
    fmu.step(0.0, 0.01)
    fmu.slave.reset()
    assert fmu.get("n") == 7
    fmu.sizes["n"] = 7
    assert fmu.everything() == before


def test_a_state_brings_its_sizes_along(make3):
    fmu = make3("controller")
    fmu.configure(n=3)
    fmu.initialize({"enable": True})
    fmu.step(0.0, 0.01)
    state, values = fmu.slave.getFMUState(), fmu.everything()
    fmu.slave.reset()
    fmu.sizes["n"] = 7
    fmu.initialize()
    fmu.slave.setFMUState(state)
    fmu.sizes["n"] = 3
    assert fmu.everything() == values
    fmu.slave.freeFMUState(state)


def test_sizes_that_cannot_be_are_refused_and_nothing_changes(make3):
    controller, grid = make3("controller"), make3("grid")
    line = controller.refused(controller.set, "n", 8)
    assert "fmi3SetUInt64: n cannot be set" in line and "configuration mode" in line
    controller.slave.enterConfigurationMode()
    for n in [0, 2**60, 2**64 - 1, 1_048_577]:
        line = controller.refused(controller.set, "n", n)
        assert f"fmi3SetUInt64: n = {n} is refused; expected 1 to 1048576" in line
    assert "expected 0 to 8388608" in controller.refused(controller.set, "n_edges", 2**60)
    assert "P is not there in configuration mode" in controller.refused(controller.get, "P")
    assert controller.get("n") == 7
    controller.slave.exitConfigurationMode()
    grid.slave.enterConfigurationMode()
    line = grid.refused(grid.set, "n", 8)
    assert "n = 8 is refused; expected 7" in line and "export another scenario" in line
    line = grid.refused(grid.set, "n_bus", 56)
    assert "n_bus = 56 is refused; expected 57" in line
    grid.set("n", 7)
    grid.slave.exitConfigurationMode()
    grid.initialize()
    assert "step mode" in grid.refused(grid.slave.enterConfigurationMode)


@pytest.mark.parametrize(
    ("rows", "pins", "says"),
    [
        ([(1, 9, 1.0)], [], "edge_to[1] = 9 is refused; expected 0 to 4"),
        ([(1, 2, -1.0)], [], "edge_weight[1] = -1"),
        ([(1, 2, 1.0)], [0, 0, -1, 0], "pin_weight[3] = -1"),
        ([(1, 2, float("nan"))], [], "edge_weight[1] = NaN"),
        ([(1, 2, 1.0), (2, 3, 1.0)], [], "edge_from, edge_to: found 2 parts; no path from agent 1 to agent 4"),
        ([(1, 2, 1.0), (2, 2, 1.0)], [], "edge_to[2]: found 2, expected another agent"),
        ([(1, 2, 1.0), (3, 0, 1.0)], [], "edge_to[2]: found 0, expected the number of an agent"),
        ([(1, 2, 1.0), (3, 2, 0.0)], [], "edge_weight[2]: found 0, expected a weight > 0"),
        ([(1, 2, 1.0), (2, 1, 0.5)], [], "found agents 2 and 1 again, as in row 1"),
    ],
)
def test_a_graph_that_cannot_be_is_refused_by_its_rows(make3, rows, pins, says):
    fmu = make3("controller")
    fmu.configure(n=4, n_edges=len(rows))
    fmu.slave.enterInitializationMode()
    columns = dict(zip(["edge_from", "edge_to", "edge_weight"], zip(*rows))) | ({"pin_weight": pins} if pins else {})
    calls = [(fmu.set, name, column) for name, column in columns.items()] + [(fmu.slave.exitInitializationMode,)]
    for call in calls:
        before = saved(fmu)
        try:
            call[0](*call[1:])
        except FMICallException:
            break
    else:
        raise AssertionError("nothing was refused")
    assert says in fmu.lines[-1][2] and len(fmu.lines) == 1
    assert saved(fmu) == before
    # And it can be put right.
    for name in columns:
        fmu.set(name, 0)
    fmu.slave.exitInitializationMode()
    fmu.step(0.0, 0.01)


def test_a_topology_that_is_no_longer_there_is_not_kept_in_silence(make3):
    fmu = make3("controller")
    fmu.set("topology", 2)
    fmu.configure(n=5)
    assert fmu.get("topology") == 1
    ((status, category, line),) = fmu.lines
    assert (status, category) == (1, "logStatusWarning") and "topology = 2 is not kept" in line


def test_pins_without_edges_want_edges(make3):
    fmu = make3("controller")
    fmu.set("pin_weight", [0, 1, 0, 0, 0, 0, 0])
    fmu.slave.enterInitializationMode()
    line = fmu.refused(fmu.slave.exitInitializationMode)
    assert "pin_weight[2]: found a weight and no edges" in line


def saved(fmu):
    """The FMU state as bytes."""
    state = fmu.slave.getFMUState()
    try:
        return fmu.slave.serializeFMUState(state)
    finally:
        fmu.slave.freeFMUState(state)


def test_100_000_agents_are_one_variable_for_each_quantity(three, make3, tmp_path):
    n = 100_000
    file = three("controller", write(tmp_path, n, ring(n), [(1, 1.0)]), "--fmi", "3")

    def description(archive):
        with zipfile.ZipFile(archive) as opened:
            text = opened.read("modelDescription.xml")
        return text, [v.get("name") for v in ElementTree.fromstring(text).find("ModelVariables")]

    (small, few), (large, many) = description(three("controller", "case1", "--fmi", "3")), description(file)
    assert few == many and len(few) == 55
    # Start values that differ are written out: of four arrays that follow K_P, and K_Q and omega_set_start.
    assert len(large) < len(small) + 5 * 25 * n
    start = {"enable": True, "omega": 1 + 1e-3 * np.sin(np.arange(n))}
    result = simulate_fmu(
        str(file), stop_time=0.05, output_interval=0.01, start_values=start, output=["omega_set", "spread_P"]
    )
    assert result["omega_set"].shape == (6, n)
    assert (result["omega_set"][0] == np.array(OMEGA_SET)[np.arange(n) % 7]).all()
    # Every agent has a neighbour that is faster or slower.
    assert not (result["omega_set"][-1] == result["omega_set"][0]).any()
    # The same from case1's FMU.
    other = make3("controller")
    other.configure(n=n)
    other.initialize(start)
    for k in range(5):
        other.step(k * 0.01, 0.01)
    assert packed(other.get("omega_set")) == packed(result["omega_set"][-1])
