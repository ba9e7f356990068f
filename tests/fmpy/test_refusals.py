"""Calls that must be refused: with an error, a line that names the culprit, and nothing changed."""

import contextlib
import math

import pytest
from fmus import FMICallException

STEP = 0.01


@contextlib.contextmanager
def refused(fmu, *words):
    """The call inside fails, logs a line that holds all these words, and changes no value."""
    before, mark = fmu.everything(), len(fmu.log())
    with pytest.raises(FMICallException) as caught:
        yield
    assert caught.value.status == 3, "fmi2Error, from which one can go on"
    lines = fmu.log()[mark:]
    assert any(all(word in line for word in words) for line in lines), lines
    assert fmu.everything() == before


@pytest.fixture(params=[False, True], ids=["instantiated", "stepping"])
def moving(request):
    return request.param


def begin(fmu, moving):
    fmu.set("P" if "eta" in fmu.variables else "omega_set", 1.0)
    if moving:
        fmu.initialize()
        fmu.step(0.0, STEP)


def proceeds(fmu, moving):
    """After a refusal the instance is as good as before."""
    if not moving:
        fmu.initialize()
        fmu.step(0.0, STEP)
    fmu.step(STEP, STEP)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("which,name", [("controller", "P[3]"), ("grid", "V_set[2]")])
def test_input_that_is_no_number(make, which, name, value, moving):
    fmu = make(which)
    begin(fmu, moving)
    with refused(fmu, name):
        fmu.set(name, value)
    proceeds(fmu, moving)


def test_one_bad_value_keeps_out_its_whole_call(controller):
    controller.initialize()
    with refused(controller, "omega[7]"):
        controller.set("omega", [1.001, 1.002, 1.003, 1.004, 1.005, 1.006, math.nan])


@pytest.mark.parametrize(
    "name,value",
    [("eta", 0.0), ("eta", -0.5), ("gain_P", -1.0), ("delay", -0.1), ("theta_E", -1.0), ("topology", 0), ("topology", 99)],
)
def test_values_outside_their_range(controller, name, value, moving):
    begin(controller, moving)
    with refused(controller, name):
        controller.set(name, value)
    proceeds(controller, moving)


@pytest.mark.parametrize("name,value", [("voltage_policy", 2), ("discretisation", -1), ("K_P[2]", 0.0), ("capacity[1]", -1.0)])
def test_fixed_parameters_outside_their_range(controller, name, value):
    with refused(controller, name):
        controller.set(name, value)


@pytest.mark.parametrize("which,name", [("controller", "K_P[1]"), ("grid", "E_start[1]"), ("grid", "omega_c")])
def test_a_fixed_parameter_during_the_simulation(make, which, name):
    fmu = make(which)
    fmu.initialize()
    fmu.step(0.0, STEP)
    with refused(fmu, name):
        fmu.set(name, fmu.get(name) * 2)


@pytest.mark.parametrize("which,name", [("controller", "omega_set[1]"), ("grid", "P[1]")])
def test_an_output_cannot_be_set(make, which, name, moving):
    fmu = make(which)
    begin(fmu, moving)
    with refused(fmu, name):
        fmu.set(name, 1.0)


@pytest.mark.parametrize("which", ["controller", "grid"])
def test_value_references_and_types_that_do_not_exist(make, which):
    fmu = make(which)
    fmu.initialize()
    with refused(fmu, "4000000000"):
        fmu.slave.setReal([4_000_000_000], [1.0])
    with refused(fmu, "4000000000"):
        fmu.slave.getReal([4_000_000_000])
    flag = {"controller": "enable", "grid": "tie_closed"}[which]
    with refused(fmu, flag):
        fmu.slave.setReal([fmu.variables[flag].valueReference], [1.0])


@pytest.mark.parametrize("which", ["controller", "grid"])
def test_steps_that_cannot_be(make, which):
    fmu = make(which)
    fmu.initialize()
    fmu.step(0.0, STEP)
    for time, step in [(STEP, -STEP), (STEP, math.nan), (math.nan, STEP), (STEP, math.inf), (1.0, STEP), (0.0, STEP)]:
        with refused(fmu, "fmi2DoStep"):
            fmu.step(time, step)
    before = fmu.everything()
    fmu.step(STEP, 0.0)
    assert fmu.everything() == before, "a step of no length changes nothing"
    fmu.step(STEP, STEP)


@pytest.mark.parametrize("which", ["controller", "grid"])
def test_a_step_before_initialisation(make, which):
    fmu = make(which)
    with refused(fmu, "fmi2DoStep"):
        fmu.step(0.0, STEP)
    fmu.initialize()
    fmu.step(0.0, STEP)
