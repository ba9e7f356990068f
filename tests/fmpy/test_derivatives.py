"""Derivatives through the C interface, as FMPy calls it; both interfaces in FMPy's validation and the FMI schema."""

import subprocess

import fmpy
import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from fmus import FMICallException, Fmu

STEP = 0.01


@pytest.fixture(params=["controller", "grid"])
def which(request):
    return request.param


@pytest.fixture(scope="module")
def portable(bess, tmp_path_factory):
    """Both FMUs with flat names and nothing but Reals."""
    folder = tmp_path_factory.mktemp("portable")
    made = {}
    for part in ["controller", "grid"]:
        made[part] = folder / f"{part}.fmu"
        subprocess.run([bess, "export", part, "case1", "--portable", "-o", made[part]], check=True)
    return made


def continuous(fmu, causality):
    """Names of the continuous Reals of this causality."""
    variables = fmu.variables.values()
    return [v.name for v in variables if (v.type, v.causality, v.variability) == ("Real", causality, "continuous")]


def references(fmu, names):
    return [fmu.variables[name].valueReference for name in names]


def directional(fmu, unknowns, knowns, seeds):
    return np.array(fmu.slave.getDirectionalDerivative(references(fmu, unknowns), references(fmu, knowns), seeds))


def ramp(fmu, rates):
    fmu.slave.setRealInputDerivatives(references(fmu, rates), [1] * len(rates), list(rates.values()))


def rates(fmu, names):
    return np.array(fmu.slave.getRealOutputDerivatives(references(fmu, names), [1] * len(names)))


def test_the_description_declares_them(archives, portable, which):
    for archive in [archives[which], portable[which]]:
        slave = read_model_description(str(archive), validate=True).coSimulation
        assert slave.providesDirectionalDerivative
        assert slave.canInterpolateInputs
        assert slave.maxOutputDerivativeOrder == 1


def test_schema_and_validation_find_nothing_in_either_interface(archives, portable, which):
    for archive in [archives[which], portable[which]]:
        # Against the XML schema of FMI 2.0, which FMPy carries.
        read_model_description(str(archive), validate=True, validate_variable_names=True)
        assert validate_fmu(str(archive)) == []


def test_every_real_has_a_unit_that_is_defined(make, which):
    description = make(which).description
    units = {unit.name: {display.name for display in unit.displayUnits} for unit in description.unitDefinitions}
    for variable in description.modelVariables:
        if variable.type == "Real":
            assert variable.unit in units, variable.name
            assert variable.displayUnit is None or variable.displayUnit in units[variable.unit], variable.name


def test_droop_and_sharing_to_the_last_digit(make):
    grid, controller = make("grid").initialize(), make("controller").initialize({"enable": True, "P": 2.0})
    K_P, K_Q = grid.get("K_P"), grid.get("K_Q")
    for i in range(7):
        setpoints = [f"{name}[{i + 1}]" for name in ["omega_set", "P_set", "V_set", "Q_set"]]
        found = directional(grid, [f"omega[{i + 1}]", f"V[{i + 1}]"], setpoints, [1.0, 2.0, 3.0, 4.0])
        assert np.abs(found - [1 + 2 * K_P[i], 3 + 4 * K_Q[i]]).max() < 1e-15
        assert (directional(grid, grid.arrays["P"] + grid.arrays["Q"] + grid.arrays["E"], setpoints, [1.0] * 4) == 0).all()
    # What one agent gives its neighbours take, in derivatives too.
    controller.set("P", np.linspace(1.0, 2.5, 7))
    for name in controller.arrays["P"]:
        assert abs(directional(controller, controller.arrays["u_P"], [name], [1.0]).sum()) < 1e-15


@pytest.mark.parametrize("interface", ["structured", "portable"])
def test_differences_of_all_outputs(archives, portable, tmp_path, which, interface):
    archive = {"structured": archives, "portable": portable}[interface][which]
    fmpy.extract(archive, tmp_path)
    with Fmu(tmp_path, which) as fmu:
        given = {"controller": {"enable": True}, "grid": {}}[which]
        fmu.initialize(given)
        fmu.step(0.0, STEP)
        knowns, unknowns = continuous(fmu, "input"), continuous(fmu, "output")
        random = np.random.default_rng(1)
        point = np.array(fmu.get_all(knowns)) + 1e-3 * random.uniform(-1, 1, len(knowns))
        along = random.uniform(-1, 1, len(knowns))

        def at(s):
            fmu.set_all(knowns, point + s * along)
            return np.array(fmu.get_all(unknowns))

        h = 1e-7
        central = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
        at(0.0)
        found = directional(fmu, unknowns, knowns, along)
        size = np.abs(found)
        assert (size > 1e-3).sum() > len(unknowns) // 4, "most of them move"
        # Rounding of values near 1, divided by h, is 1e-9.
        assert (np.abs(found - central) <= 1e-6 * np.maximum(size, 1e-2)).all()


@pytest.mark.parametrize("length", [0.1, 0.02])
def test_simulate_fmu_with_input_derivatives(archives, length):
    # A ramp of all frequency setpoints of an island moves its frequency, and nothing else but the angles.
    # FMPy holds the first sample of a signal: one before the start makes the ramp begin at the start.
    time = np.arange(-length, 1.001, length)
    with Fmu(fmpy.extract(str(archives["grid"])), "grid") as fmu:
        names = fmu.arrays["omega_set"]
        start = fmu.get("omega_set")
    # FMPy 0.3.32 has room for exactly nine derivatives: two inputs that rest make up the number.
    resting = ["dP_load[1]", "dQ_load[1]"]
    dtype = [("time", float)] + [(name, float) for name in [*names, *resting]]
    signals = np.array([(t, *(start + 1e-3 * t), 0.0, 0.0) for t in time], dtype=dtype)
    result = simulate_fmu(
        str(archives["grid"]),
        stop_time=1.0,
        output_interval=length,
        input=signals,
        set_input_derivatives=True,
        output=["omega[1]", "omega[7]", "bus_angle[5]", "P[1]"],
    )
    t = result["time"]
    for name in ["omega[1]", "omega[7]"]:
        assert np.abs(result[name] - result[name][0] - 1e-3 * t).max() < 1e-9
    # d delta/dt = omega_b (omega - 1): a parabola on top of the straight line at the start's frequency, which the
    # staircase of held inputs would miss by omega_b 1e-3 h / 2 a second.
    omega_b = 2 * np.pi * 60
    turned = omega_b * ((result["omega[1]"][0] - 1) * t + 1e-3 * t**2 / 2)
    found = np.unwrap(result["bus_angle[5]"]) - result["bus_angle[5]"][0]
    error = np.angle(np.exp(1j * (found - turned)))
    assert np.abs(error).max() < 1e-7
    assert np.ptp(result["P[1]"]) < 1e-7


def test_a_ramp_holds_for_one_step(make):
    grid = make("grid").initialize()
    before = grid.get("V_set[3]")
    ramp(grid, {"V_set[3]": 0.5})
    grid.step(0.0, STEP)
    assert abs(grid.get("V_set[3]") - before - 0.5 * STEP) < 1e-15
    arrived = grid.get("V_set[3]")
    grid.step(STEP, STEP)
    assert grid.get("V_set[3]") == arrived


def test_the_setpoints_rate_is_u(make):
    controller = make("controller")
    controller.initialize({"enable": True, "P": np.linspace(1.0, 3.0, 7), "omega": np.linspace(0.999, 1.001, 7)})
    controller.step(0.0, STEP)
    assert (rates(controller, controller.arrays["omega_set"]) == controller.get("u_omega")).all()
    assert (rates(controller, controller.arrays["V_set"]) == controller.get("u_V")).all()
    assert np.abs(controller.get("u_omega")).max() > 1e-3


def test_the_grid_moves_at_its_rates(make):
    grid = make("grid").initialize()
    grid.set("omega_set[2]", 1.01)
    grid.step(0.0, STEP)
    names = [name for q in ["P", "Q", "E", "bus_V"] for name in grid.arrays[q]]
    found, before = rates(grid, names), np.array(grid.get_all(names))
    h = 1e-5
    grid.step(STEP, h)
    middle = np.array(grid.get_all(names))
    grid.step(STEP + h, h)
    forward = (-3 * before + 4 * middle - np.array(grid.get_all(names))) / (2 * h)
    assert np.abs(found - forward).max() < 1e-5 * np.abs(found).max()
    assert np.abs(found).max() > 0.01


def test_what_has_no_derivative_is_refused(make, which):
    fmu = make(which).initialize()
    inputs, outputs = continuous(fmu, "input"), continuous(fmu, "output")
    flag = {"controller": "enable", "grid": "tie_closed"}[which]
    before = fmu.everything()
    for call in [
        lambda: directional(fmu, outputs[:1], outputs[:1], [1.0]),
        lambda: directional(fmu, inputs[:1], inputs[:1], [1.0]),
        lambda: directional(fmu, outputs[:1], [flag], [1.0]),
        lambda: directional(fmu, outputs[:1], inputs[:1], [float("nan")]),
        lambda: fmu.slave.setRealInputDerivatives(references(fmu, inputs[:1]), [2], [1.0]),
        lambda: fmu.slave.setRealInputDerivatives(references(fmu, outputs[:1]), [1], [1.0]),
        lambda: fmu.slave.getRealOutputDerivatives(references(fmu, outputs[:1]), [2]),
        lambda: fmu.slave.getRealOutputDerivatives(references(fmu, inputs[:1]), [1]),
    ]:
        mark = len(fmu.log())
        with pytest.raises(FMICallException) as caught:
            call()
        assert caught.value.status == 3
        assert len(fmu.log()) == mark + 1, fmu.log()[mark:]
        assert fmu.everything() == before
