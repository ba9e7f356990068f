"""What an importer sees before it runs anything: the archive, the description, the library's symbols."""

import subprocess
import xml.etree.ElementTree as ElementTree
import zipfile

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

MODELS = {"controller": "BessConsensus", "grid": "BessGrid"}

FUNCTIONS = """
GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment
EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString
SetReal SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize
SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative
SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus
GetIntegerStatus GetBooleanStatus GetStringStatus
""".split()

# Name -> (type, causality, variability, is an array). The contract that users' connections rely on.
CONTROLLER = {
    **dict.fromkeys(["P", "Q", "V", "omega", "E"], ("Real", "input", "continuous", True)),
    **dict.fromkeys(["omega_ref", "V_ref", "P_ref"], ("Real", "input", None, False)),
    **dict.fromkeys(["enable", "dispatch"], ("Boolean", "input", "discrete", False)),
    "available": ("Boolean", "input", "discrete", True),
    "topology": ("Integer", "input", "discrete", False),
    **dict.fromkeys(["omega_set", "V_set", "P_set", "Q_set"], ("Real", "output", None, True)),
    **dict.fromkeys(["u_omega", "u_P", "u_E", "u_V", "u_Q"], ("Real", "output", None, True)),
    **dict.fromkeys(["spread_P", "spread_Q", "spread_E"], ("Real", "output", None, False)),
    **dict.fromkeys(["error_omega", "error_V"], ("Real", "output", None, False)),
    **dict.fromkeys(["lambda_2", "T_P", "T_omega"], ("Real", "output", None, False)),
    "cluster": ("Integer", "output", "discrete", True),
    "saturated": ("Boolean", "output", "discrete", True),
    **dict.fromkeys(["eta", "delay", "theta_min", "theta_E"], ("Real", "parameter", "tunable", False)),
    **dict.fromkeys([f"gain_{x}" for x in ["omega", "P", "E", "V", "Q"]], ("Real", "parameter", "tunable", False)),
    **dict.fromkeys(["voltage_policy", "discretisation"], ("Integer", "parameter", "fixed", False)),
    **dict.fromkeys(["K_P", "K_Q", "capacity", "P_exchange_max"], ("Real", "parameter", "fixed", True)),
    **dict.fromkeys(["omega_set_start", "V_set_start"], ("Real", "parameter", "fixed", True)),
}
GRID = {
    **dict.fromkeys(["omega_set", "V_set", "P_set", "Q_set"], ("Real", "input", None, True)),
    **dict.fromkeys(["dP_load", "dQ_load"], ("Real", "input", None, True)),
    "tie_closed": ("Boolean", "input", "discrete", False),
    **dict.fromkeys(["P", "Q", "V", "omega", "E"], ("Real", "output", "continuous", True)),
    **dict.fromkeys(["bus_V", "bus_angle"], ("Real", "output", None, True)),
    **dict.fromkeys(["tie_P", "tie_Q"], ("Real", "output", None, False)),
    **dict.fromkeys(["E_start", "K_P", "K_Q", "X_c"], ("Real", "parameter", "fixed", True)),
    "omega_c": ("Real", "parameter", "fixed", False),
}
CONTRACT = {"controller": CONTROLLER, "grid": GRID}


@pytest.fixture(params=MODELS)
def which(request):
    return request.param


@pytest.fixture
def xml(folders, which):
    return ElementTree.parse(folders[which] / "modelDescription.xml").getroot()


def test_fmpy_finds_nothing_to_complain_about(archives, which):
    assert validate_fmu(str(archives[which])) == []


def test_every_variable_of_the_contract_is_there(make, which):
    fmu = make(which)
    for quantity, (kind, causality, variability, is_array) in CONTRACT[which].items():
        assert (quantity in fmu.arrays) == is_array, quantity
        for name in fmu.names(quantity):
            found = fmu.variables[name]
            assert (found.type, found.causality) == (kind, causality), name
            assert variability in (None, found.variability), name


def test_nothing_else_is_in_the_interface(make, which):
    fmu = make(which)
    scalars = {name for name in fmu.variables if "[" not in name}
    assert scalars | set(fmu.arrays) == set(CONTRACT[which])


def test_arrays_of_one_side_fit_the_other(make):
    controller, grid = make("controller"), make("grid")
    for quantity in ["P", "Q", "V", "omega", "E", "omega_set", "V_set", "P_set", "Q_set"]:
        assert controller.arrays[quantity] == grid.arrays[quantity]


def test_the_description_keeps_what_importers_demand(xml, which):
    assert xml.get("fmiVersion") == "2.0"
    assert xml.get("variableNamingConvention") == "structured"
    assert not {"{", "}"} & set(xml.get("guid"))
    slave = xml.find("CoSimulation")
    assert slave.get("modelIdentifier") == MODELS[which]
    assert slave.get("needsExecutionTool", "false") == "false"
    assert slave.get("canBeInstantiatedOnlyOncePerProcess", "false") == "false"
    assert xml.find("DefaultExperiment") is not None

    variables = list(xml.find("ModelVariables"))
    assert len({v.get("name") for v in variables}) == len(variables)
    assert len({v.get("valueReference") for v in variables}) == len(variables)
    for variable in variables:
        value = variable[0]
        name, causality = variable.get("name"), variable.get("causality")
        assert value.tag in {"Real", "Integer", "Boolean"}, name
        assert causality in {"input", "output", "parameter"}, name
        assert (value.get("start") is not None) == (causality != "output"), name
        if causality == "input":
            assert variable.get("initial") is None, name


def test_every_output_states_its_dependencies(xml):
    variables = list(xml.find("ModelVariables"))
    outputs = [i for i, v in enumerate(variables, 1) if v.get("causality") == "output"]
    for part in ["Outputs", "InitialUnknowns"]:
        unknowns = list(xml.find(f"ModelStructure/{part}"))
        assert [int(u.get("index")) for u in unknowns] == outputs, part
        for unknown in unknowns:
            assert unknown.get("dependencies") is not None, unknown.get("index")
            causes = [int(i) for i in unknown.get("dependencies").split()]
            assert causes == sorted(set(causes))
    assert xml.find("ModelStructure/Derivatives") is None


def test_setpoints_are_sampled_and_frequency_follows_them_at_once(folders):
    def dependencies(which):
        root = ElementTree.parse(folders[which] / "modelDescription.xml").getroot()
        names = [v.get("name") for v in root.find("ModelVariables")]
        rows = root.find("ModelStructure/Outputs")
        return {
            names[int(row.get("index")) - 1]: {names[int(i) - 1] for i in row.get("dependencies").split()}
            for row in rows
        }

    controller, grid = dependencies("controller"), dependencies("grid")
    for i in range(1, 8):
        for quantity in ["omega_set", "V_set", "P_set", "Q_set"]:
            assert controller[f"{quantity}[{i}]"] == set()
        assert f"omega[{i}]" in controller[f"u_omega[{i}]"]
        assert f"omega_set[{i}]" in grid[f"omega[{i}]"]
        assert f"V_set[{i}]" in grid[f"V[{i}]"]
        for state in ["P", "Q", "E"]:
            assert grid[f"{state}[{i}]"] == set()


def test_the_checked_in_description_is_that_of_the_fmu(root, archives, which):
    name = MODELS[which]
    checked_in = root / "modelDescription" / f"{name}.xml"
    with zipfile.ZipFile(archives[which]) as archive:
        packed = archive.read("modelDescription.xml").decode()
    assert checked_in.is_file(), "run `cargo xtask generate model-description`"
    assert checked_in.read_text() == packed, "run `cargo xtask generate model-description`"


def test_the_library_exports_the_34_functions_and_those_of_fmi_3_alone(library):
    listing = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True)
    exported = [line.split()[-1] for line in listing.stdout.splitlines()]
    assert len(FUNCTIONS) == 34
    # Those of FMI 3.0, which the same library serves, are looked at in test_three.py.
    exported = [name for name in exported if not name.startswith("fmi3")]
    assert sorted(exported) == sorted(f"fmi2{name}" for name in FUNCTIONS)


def test_the_library_needs_only_the_c_runtime(library):
    listing = subprocess.run(["readelf", "-d", library], capture_output=True, text=True, check=True)
    needed = {line.split("[")[1].rstrip("]") for line in listing.stdout.splitlines() if "(NEEDED)" in line}
    # libgcc_s unwinds panics up to the fence; glibc systems have it wherever a C++ program runs.
    assert needed <= {"libc.so.6", "libm.so.6", "libgcc_s.so.1", "ld-linux-x86-64.so.2"}


@pytest.fixture
def library(folders, which):
    identifier = read_model_description(str(folders[which])).coSimulation.modelIdentifier
    return folders[which] / "binaries/linux64" / f"{identifier}.so"
