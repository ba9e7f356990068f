"""ANDES's grid-forming inverters on case57 under the controller, coupled by FMPy in steps of 100 ms.

Nobody here wrote the inverter or the network. Unlike the controller's own grid, REGF1 has inner loops, limits its
power through a PI controller and holds the voltage of the bus itself; the controller knows nothing of it.
"""

import logging

import andes_grid
import numpy
import pytest
from loop import SETTLED, Controller, Record

H = 0.1
# Errors decay with a time constant of 4 s here, so 20 s and more are left for each event.
ENABLE, LOAD, STOP = 2.0, 32.0, 62.0  # s

WHY = "with the energy exchange on, K_P P is still 1.6e-5 apart after 25 s: P_set moves in steps of 100 ms. The bar is 1e-5"
# Strict: once the bar is met, this and docs/your-grid.md have to say so.
MISSED = pytest.mark.xfail(raises=AssertionError, strict=True, reason=WHY)


@pytest.fixture
def grid(tmp_path):
    logging.getLogger("andes").setLevel(logging.ERROR)
    return andes_grid.AndesGrid(tmp_path)


def test_the_inverters_droop_as_the_controller_expects(grid):
    """omega = omega_set - K_P (P - P_set) and V = V_set - K_Q (Q - Q_set), once the inner loops are through."""
    omega_set = grid.omega_set + 1e-3 * numpy.array([1.5, -1, 0.5, -1.5, 1, -0.5, 0])
    P_set = numpy.array([0.1, -0.1, 0.2, 0, -0.2, 0, 0])
    Q_set = numpy.array([0, 0.1, 0, -0.1, 0, 0.2, -0.2])
    grid.set(omega_set, grid.V_set, P_set, Q_set)
    for _ in range(100):
        grid.step(H)
    m = grid.measure()
    # 10 s are 40 time constants of the slowest mode (4.2 1/s); what is left is the solver's tolerance, 1e-8.
    assert numpy.abs(m["omega"] - (omega_set - andes_grid.K_P * (m["P"] - P_set))).max() < 1e-7
    assert numpy.abs(m["V"] - (grid.V_set - andes_grid.K_Q * (m["Q"] - Q_set))).max() < 1e-6
    assert numpy.ptp(m["omega"]) < 1e-7


@pytest.mark.parametrize("exchange", [False, pytest.param(True, marks=MISSED)])
def test_frequency_and_sharing_settle(grid, controller_fmu, exchange):
    start = {"omega_set_start": grid.omega_set, "V_set_start": grid.V_set}
    controller = Controller(controller_fmu, **start)
    if not exchange:
        controller.set("gain_E", 0.0)
    controller.start(grid.measure())
    record = Record(andes_grid.K_P)
    for k in range(round(STOP / H)):
        if k == round(ENABLE / H):
            controller.set("enable", True)
        if k == round(LOAD / H):
            grid.add_load(12, -0.5, -0.5)
        setpoints, measured = controller.setpoints(), grid.measure()
        record.add(k * H, measured, setpoints)
        controller.measure(measured)
        grid.set(**setpoints)
        controller.step(k * H, H)
        grid.step(H)
    controller.close()

    omega, shares = record.worst(0, ENABLE)
    assert omega < 1e-9 and shares > 1e-2, "the case as it is: nominal frequency, no sharing"
    for begin, end in ((LOAD - 5, LOAD - H), (STOP - 5, STOP)):
        omega, shares = record.worst(begin, end)
        print(f"exchange {exchange}, {begin} to {end} s: omega {omega:.1e}, K_P (P - P_set) {shares:.1e}")
        assert omega < SETTLED and shares < SETTLED
    # The load step is felt: half a pu over the sum of 1 / K_P, 1700 pu, is 3e-4.
    omega, _ = record.worst(LOAD, LOAD + 1)
    assert omega > 1e-4
