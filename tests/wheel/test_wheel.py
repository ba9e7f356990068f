"""What a user without Rust gets: pip installs the wheel, `bess` exports for a scenario of their own, FMPy runs it."""

import json
import zipfile

import fmpy
import numpy as np
import pytest

BATTERIES = 4


@pytest.fixture(scope="module")
def scenario(bess):
    """Four batteries at other buses and other gains than those of any built-in scenario."""
    shown = bess("show", "case1")
    assert shown.returncode == 0, shown.stderr
    document = json.loads(shown.stdout)
    document["name"] = "mine"
    document["bess"] = [
        {"bus": bus, "K_P": 0.003 + 0.001 * i, "K_Q": 0.02, "soc_start": 0.6 + 0.002 * i, "omega_set_start": 1 + 0.001 * i}
        for i, bus in enumerate([1, 3, 8, 12])
    ]
    document["events"] = [{"at_s": 2, "set": {"controller.enable": True}}]
    document.pop("compare", None)
    file = bess.folder / "mine.json"
    file.write_text(json.dumps(document))
    return file


@pytest.fixture(scope="module")
def exported(bess, scenario):
    """The two FMUs for it."""
    files = {}
    for part in ["controller", "grid"]:
        written = bess("export", part, scenario.name, "-o", f"{part}.fmu")
        assert written.returncode == 0, written.stderr
        files[part] = bess.folder / f"{part}.fmu"
    return files


def test_the_wheel_is_for_any_linux_of_the_last_ten_years(wheel):
    """manylinux2014 is glibc 2.17; py3-none: no Python interface, so one wheel for every Python."""
    assert "-py3-none-manylinux" in wheel.name and wheel.name.endswith("_x86_64.whl")
    assert "manylinux2014" in wheel.name or "manylinux_2_17" in wheel.name
    with zipfile.ZipFile(wheel) as archive:
        assert any(name.endswith("/scripts/bess") for name in archive.namelist())


def test_bess_carries_the_libraries(bess):
    said = bess("--version")
    assert said.returncode == 0
    assert "carries the shared libraries for linux64, win64, aarch64-linux" in said.stdout


def test_an_fmu_of_ones_own_runs_in_fmpy(exported):
    """The controller alone: held off its reference with unequal shares it moves its setpoints towards both."""
    file = exported["controller"]
    description = fmpy.read_model_description(file, validate=True)
    names = {variable.name for variable in description.modelVariables}
    assert f"omega_set[{BATTERIES}]" in names and f"omega_set[{BATTERIES + 1}]" not in names

    outputs = [f"omega_set[{i}]" for i in range(1, BATTERIES + 1)]
    values = {"enable": True} | {f"omega[{i}]": 0.999 for i in range(1, BATTERIES + 1)}
    result = fmpy.simulate_fmu(
        file, stop_time=2.0, step_size=0.01, output_interval=0.01, start_values=values, output=outputs
    )
    first, last = (np.array([result[row][name] for name in outputs]) for row in (0, -1))
    assert np.isfinite(last).all()
    assert last.mean() > first.mean() + 1e-4, "the frequency is low, so the setpoints rise"


def test_the_pair_settles(exported, tmp_path):
    """Both FMUs in an FMPy loop: frequency and shares settle for the four batteries."""
    from fmpy.fmi2 import FMU2Slave

    slaves, references = {}, {}
    for part, file in exported.items():
        folder = fmpy.extract(file, tmp_path / part)
        description = fmpy.read_model_description(folder)
        references[part] = {v.name: v.valueReference for v in description.modelVariables}
        identifier = description.coSimulation.modelIdentifier
        slave = FMU2Slave(
            guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName=part
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slaves[part] = slave

    def elements(part, quantity):
        return [references[part][f"{quantity}[{i}]"] for i in range(1, BATTERIES + 1)]

    def hand_on(source, sink, quantities):
        for quantity in quantities:
            slaves[sink].setReal(elements(sink, quantity), slaves[source].getReal(elements(source, quantity)))

    def exchange():
        hand_on("controller", "grid", ["omega_set", "V_set", "P_set", "Q_set"])
        hand_on("grid", "controller", ["P", "Q", "V", "omega", "E"])

    exchange()
    exchange()
    for slave in slaves.values():
        slave.exitInitializationMode()
    slaves["controller"].setReal([references["controller"]["gain_E"]], [0.0])
    for k in range(4000):
        exchange()
        if k == 200:
            slaves["controller"].setBoolean([references["controller"]["enable"]], [True])
        for slave in slaves.values():
            slave.doStep(k * 0.01, 0.01)
    omega = np.array(slaves["grid"].getReal(elements("grid", "omega")))
    power = np.array(slaves["grid"].getReal(elements("grid", "P")))
    gains = np.array(slaves["controller"].getReal(elements("controller", "K_P")))
    assert np.abs(omega - 1).max() < 1e-7
    assert np.ptp(gains * power) < 1e-7
    assert np.ptp(power) > 0.01, "the shares differ, so equal K_P P means something"
    for slave in slaves.values():
        slave.terminate()
        slave.freeInstance()
