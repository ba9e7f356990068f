"""Each FMU by itself, without the other: what it must do is known in closed form."""

import numpy as np
import pytest
from fmpy import simulate_fmu

STEPS = [0.01, 0.1]


@pytest.mark.parametrize("step", STEPS)
def test_the_grid_starts_in_its_steady_state_and_stays_there(archives, grid, step):
    names = [name for q in ["P", "Q", "V", "omega", "E"] for name in grid.arrays[q]]
    result = simulate_fmu(str(archives["grid"]), stop_time=10.0, output_interval=step, output=names)
    assert len(result) == round(10.0 / step) + 1
    for quantity in ["P", "Q", "V", "omega"]:
        for name in grid.arrays[quantity]:
            assert np.ptp(result[name]) < 1e-9, name
    # dE/dt = -P / 3600, and P is constant.
    for p, e in zip(grid.arrays["P"], grid.arrays["E"]):
        expected = result[e][0] - result[p][0] * result["time"] / 3600
        assert np.abs(result[e] - expected).max() < 1e-9, e


def test_the_grid_obeys_its_droop(grid):
    grid.initialize()
    omega, V = grid.get("omega"), grid.get("V")
    droop_omega = grid.get("omega_set") - grid.get("K_P") * (grid.get("P") - grid.get("P_set"))
    droop_V = grid.get("V_set") - grid.get("K_Q") * (grid.get("Q") - grid.get("Q_set"))
    assert np.abs(omega - droop_omega).max() < 1e-12
    assert np.abs(V - droop_V).max() < 1e-12
    assert np.ptp(omega) < 1e-9, "an island has one frequency"
    assert grid.get("P").sum() > 1, "somebody feeds the load"


@pytest.mark.parametrize("step", STEPS)
def test_the_controller_holds_its_setpoints_until_enabled(archives, controller, step):
    names = [name for q in ["omega_set", "V_set", "P_set", "Q_set"] for name in controller.arrays[q]]
    result = simulate_fmu(str(archives["controller"]), stop_time=2.0, output_interval=step, output=names)
    assert len(result) == round(2.0 / step) + 1
    controller.initialize()
    start = {q: controller.get(f"{q}_start") for q in ["omega_set", "V_set"]}
    assert np.abs(start["omega_set"] - (1 + np.array([1.5, -1, 0.5, -1.5, 1, -0.5, 0]) * 1e-3)).max() < 1e-15
    assert (start["V_set"] == 1.02).all()
    for quantity in ["omega_set", "V_set"]:
        for name, value in zip(controller.arrays[quantity], start[quantity]):
            assert (result[name] == value).all(), name
    for quantity in ["P_set", "Q_set"]:
        for name in controller.arrays[quantity]:
            assert (result[name] == 0).all(), name


def test_at_consensus_nothing_moves(controller):
    K_P, K_Q, capacity = (controller.get(q) for q in ["K_P", "K_Q", "capacity"])
    controller.initialize(
        {"enable": True, "P": 0.006 / K_P, "Q": 0.01 / K_Q, "omega": 1.0, "V": 1.0, "E": 0.7 * capacity}
    )
    before = controller.get("omega_set"), controller.get("V_set")
    for k in range(100):
        controller.step(k * 0.01, 0.01)
    for quantity in ["u_omega", "u_P", "u_E", "u_V", "u_Q", "P_set"]:
        # Rounding leaves 1e-16 between states of charge: 3600 C / theta_E times as much power.
        assert np.abs(controller.get(quantity)).max() < 1e-11, quantity
    assert np.abs(controller.get("omega_set") - before[0]).max() < 1e-11
    assert np.abs(controller.get("V_set") - before[1]).max() < 1e-11


def test_the_setpoints_are_the_integrals_of_the_control_inputs(controller):
    controller.initialize(disturbed(controller))
    step = 0.01
    controller.step(0.0, step)
    for k in range(1, 20):
        expected = {q: controller.get(f"{q}_set") + step * controller.get(f"u_{q}") for q in ["omega", "V"]}
        controller.step(k * step, step)
        for quantity, value in expected.items():
            assert np.abs(controller.get(f"{quantity}_set") - value).max() < 1e-14, quantity


def test_what_one_agent_gives_its_neighbours_take(controller):
    controller.initialize(disturbed(controller))
    controller.step(0.0, 0.01)
    for quantity in ["u_P", "u_Q", "P_set"]:
        values = controller.get(quantity)
        assert np.abs(values).max() > 1e-6, f"{quantity} is at work"
        assert abs(values.sum()) < 1e-13 * np.abs(values).sum() + 1e-15, quantity


def test_only_pinned_agents_feel_the_virtual_leader(controller):
    charge = 0.7 * controller.get("capacity")
    controller.initialize({"enable": True, "P": 0.0, "Q": 0.0, "omega": 0.999, "V": 1.0, "E": charge})
    controller.step(0.0, 0.01)
    u = controller.get("u_omega")
    pulled = u > 1e-3
    # Rounding of the states of charge moves some 1e-13 of power, which is shared.
    assert np.abs(u[~pulled]).max() < 1e-11
    # One active leader in each cluster.
    assert sorted(controller.get("cluster")[pulled]) == sorted(set(controller.get("cluster")))
    assert abs(controller.get("error_omega") - 0.001) < 1e-15


def disturbed(controller):
    """Enabled, far from every consensus."""
    agents = np.arange(len(controller.arrays["P"]))
    return {
        "enable": True,
        "P": 1.5 + 0.1 * np.sin(agents),
        "Q": 0.5 + 0.1 * np.cos(agents),
        "omega": 1 + 1e-3 * np.sin(2 * agents),
        "V": 1 + 1e-2 * np.cos(3 * agents),
        "E": controller.get("capacity") * (0.7 + 1e-3 * np.sin(5 * agents)),
    }
