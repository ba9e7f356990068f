"""The IEEE 57-bus system in ANDES with seven of its droop-controlled grid-forming inverters (REGF1).

The network is pandapower's case57, the generators are replaced by REGF1 with ANDES's own voltage, current and
power loops; its loads become impedances, as ANDES does it. Per unit on 100 MVA, which is also each inverter's base.

REGF1's droop is omega = 1 + wdrp (x - P), x being the output of its power limiter, a PI controller on Paux. With
the integral part off (KIplim = 0, no inverter is at a limit here), x = P_0 + KPplim Paux, P_0 being the power at the
start. A frequency setpoint therefore enters as Paux = ((omega_set - 1) / wdrp + P_set - P_0) / KPplim, and so
for the voltage with vref = V_set - Qdrp Q_0 and Qref in Qaux.
"""

import pathlib

import andes
import numpy
import pandapower
import pandapower.networks
from pandapower.converter.pypower.to_ppc import to_ppc

BUSES = [1, 2, 3, 6, 8, 9, 12]
SHARES = numpy.array([1.0, 1.2, 1.25, 0.9, 0.95, 1.02, 1.1])  # relative droops of the paper's Table I
K_P, K_Q = 0.004 * SHARES, 0.02 * SHARES
CAPACITY = 0.5 / SHARES  # pu*h
SOC_START = numpy.array([0.704, 0.703, 0.702, 0.7, 0.699, 0.698, 0.696])
INNER_STEP_S = 0.01


def write_matpower(file):
    """pandapower's case57 as a MATPOWER case; its buses are numbered from 1 as in the original."""
    case = to_ppc(pandapower.networks.case57(), init="flat")
    bus, gen, branch = case["bus"].real.copy(), case["gen"].real.copy(), case["branch"].real.copy()
    for table, columns in ((bus, [0]), (gen, [0]), (branch, [0, 1])):
        table[:, columns] += 1
    # Wide limits: what is simulated is the droop, not a generator's protection.
    gen[:, [3, 8]], gen[:, [4, 9]] = 9900.0, -9900.0

    def rows(table, count):
        return "\n".join("\t" + "\t".join(repr(float(x)) for x in row[:count]) + ";" for row in table)

    file.write_text(
        "function mpc = case57\nmpc.version = '2';\nmpc.baseMVA = 100;\n"
        f"mpc.bus = [\n{rows(bus, 13)}\n];\nmpc.gen = [\n{rows(gen, 10)}\n];\n"
        f"mpc.branch = [\n{rows(branch, 13)}\n];\n"
    )


class AndesGrid:
    """case57 under seven REGF1, in steps; values are arrays in the order of BUSES."""

    def __init__(self, folder):
        file = pathlib.Path(folder) / "case57.m"
        write_matpower(file)
        self.system = ss = andes.load(str(file), setup=False, no_output=True, default_config=True)
        machine = {int(ss.PV.bus.v[k]): ss.PV.idx.v[k] for k in range(ss.PV.n)}
        machine |= {int(ss.Slack.bus.v[k]): ss.Slack.idx.v[k] for k in range(ss.Slack.n)}
        assert sorted(machine) == BUSES
        for bus, k_p, k_q in zip(BUSES, K_P, K_Q):
            limits = {"Pmax": 99.0, "Pmin": -99.0, "Qmax": 99.0, "Qmin": -99.0, "KIplim": 0.0, "KIqlim": 0.0}
            # ANDES's default gains of the voltage loop (3 and 10) are for a weaker network: under them the
            # inverters swing against each other and grow (eigenvalues -0.02 + 2j, and 5 + 480j of the filters).
            loops = {"KPv": 10.0, "KIv": 100.0, "xf": 0.05}
            parameters = {"bus": bus, "gen": machine[bus], "Sn": 100.0, "fn": 60.0, "wdrp": k_p, "Qdrp": k_q}
            ss.add("REGF1", parameters | limits | loops)
        ss.setup()
        assert ss.PFlow.run(), "ANDES's power flow does not converge"
        ss.TDS.config.fixt, ss.TDS.config.tstep, ss.TDS.config.tol = 1, INNER_STEP_S, 1e-8
        ss.TDS.config.no_tqdm, ss.TDS.config.criteria = 1, 0
        ss.TDS.init()
        assert ss.TDS.initialized, "ANDES finds no equilibrium at the start"
        self.devices = ss.REGF1
        self.P_0, self.Q_0 = self.devices.Pe.v.copy(), self.devices.Qe.v.copy()
        # Setpoints with which the start is a steady state.
        self.omega_set, self.V_set = 1 + K_P * self.P_0, self.devices.vref.v + K_Q * self.Q_0
        self.E = SOC_START * CAPACITY
        self.time_s = 0.0

    def measure(self):
        device = self.devices
        omega = 1 + device.dw_y.v / device.w0.v
        return {"P": device.Psen_y.v, "Q": device.Qsen_y.v, "V": device.v.v, "omega": omega, "E": self.E}

    def set(self, omega_set, V_set, P_set, Q_set):
        device = self.devices
        P = (numpy.array(omega_set) - 1) / K_P + P_set - self.P_0
        device.Paux0.v[:] = P / device.KPplim.v
        device.Qaux0.v[:] = numpy.array(Q_set) / device.KPqlim.v
        device.vref.v[:] = numpy.array(V_set) - K_Q * self.Q_0

    def add_load(self, bus, P, Q):
        """A load step as an impedance that takes P + j Q at 1 pu."""
        load = self.system.PQ
        k = [int(b) for b in load.bus.v].index(bus)
        load.Req.v[k] += P
        load.Xeq.v[k] += Q

    def step(self, h):
        before = self.devices.Pe.v.copy()
        self.time_s += h
        self.system.TDS.config.tf = self.time_s
        assert self.system.TDS.run(no_summary=True), f"ANDES gave up at {self.time_s} s"
        self.E = self.E - h * (before + self.devices.Pe.v) / 2 / 3600
