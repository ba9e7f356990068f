"""pandapower's IEEE 57-bus system as a co-simulation FMU, in units of its own: MW, Mvar, kV, Hz, percent.

Nothing of bess-consensus is in here. Each inverter is one of pandapower's external grids (a voltage of given
magnitude and angle) behind its reactance at the generator's bus; droop moves magnitude and angle, a power flow
with constant-power loads gives what each delivers. Wrapped by PythonFMU, which looks for the one class in this file.
"""

import math

import pandapower
import pandapower.networks
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

BUSES = [1, 2, 3, 6, 8, 9, 12]
SHARES = [1.0, 1.2, 1.25, 0.9, 0.95, 1.02, 1.1]  # relative droops of the paper's Table I
SOC_START = [70.4, 70.3, 70.2, 70.0, 69.9, 69.8, 69.6]  # %
LOAD_BUS = 12
MVA, HZ = 100.0, 60.0
X_C = 0.1  # pu
OMEGA_C = 31.4159265358979  # rad/s, cutoff of the power measurement
SUBSTEP_S = 0.02
RECYCLE = {"trafo": False, "gen": True, "bus_pq": True}  # what changes from one power flow to the next


class Inverter:
    """A droop inverter; f = f_set - K_P (P - P_ref), v = v_set - K_Q (Q - Q_ref), both droops in pu/pu."""

    def __init__(self, share, soc_percent):
        self.K_P, self.K_Q = 0.004 * share, 0.02 * share
        self.capacity_MWh = 0.5 / share * MVA
        self.soc_percent = soc_percent
        self.kV_base = self.f_set_Hz = self.v_set_kV = 0.0
        self.P_ref_MW = self.Q_ref_Mvar = self.P_MW = self.Q_Mvar = 0.0
        self.angle = 0.0

    @property
    def f_Hz(self):
        return self.f_set_Hz - HZ * self.K_P * (self.P_MW - self.P_ref_MW) / MVA

    @property
    def v_kV(self):
        return self.v_set_kV - self.kV_base * self.K_Q * (self.Q_Mvar - self.Q_ref_Mvar) / MVA


class Case57(Fmi2Slave):
    author = "tests of bess-consensus"
    description = "IEEE 57-bus system of pandapower with seven droop inverters"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.inverters = [Inverter(share, soc) for share, soc in zip(SHARES, SOC_START)]
        self.dP_MW = self.dQ_Mvar = 0.0
        self.build()
        for bus, inverter in zip(BUSES, self.inverters):
            for name in ("f_set_Hz", "v_set_kV", "P_ref_MW", "Q_ref_Mvar"):
                self.connect(f"bess_{bus}.{name}", inverter, name, Fmi2Causality.input)
            for name in ("P_MW", "Q_Mvar", "v_kV", "f_Hz", "soc_percent"):
                self.connect(f"bess_{bus}.{name}", inverter, name, Fmi2Causality.output)
        for name in ("dP_MW", "dQ_Mvar"):
            self.connect(f"load_{LOAD_BUS}.{name}", self, name, Fmi2Causality.input)

    def connect(self, name, owner, attribute, causality):
        self.register_variable(
            Real(
                name,
                causality=causality,
                variability=Fmi2Variability.continuous,
                getter=lambda: getattr(owner, attribute),
                setter=lambda value: setattr(owner, attribute, value),
            )
        )

    def build(self):
        """The case with each generator replaced by a voltage source that delivers the same."""
        net = self.net = pandapower.networks.case57()
        number = {int(net.bus.name[index]): index for index in net.bus.index}
        pandapower.runpp(net)
        delivered = {}
        for table, results in ((net.gen, net.res_gen), (net.ext_grid, net.res_ext_grid)):
            for index in table.index:
                delivered[table.bus[index]] = complex(results.p_mw[index], results.q_mvar[index]) / MVA
        voltage = {
            bus: net.res_bus.vm_pu[bus] * complex(math.cos(angle), math.sin(angle))
            for bus, angle in ((b, math.radians(net.res_bus.va_degree[b])) for b in delivered)
        }
        net.gen.drop(net.gen.index, inplace=True)
        net.ext_grid.drop(net.ext_grid.index, inplace=True)
        self.sources = []
        for bus, inverter in zip(BUSES, self.inverters):
            at = number[bus]
            S, V = delivered[at], voltage[at]
            E = V + 1j * X_C * (S / V).conjugate()
            inverter.kV_base = net.bus.vn_kv[at]
            inverter.angle = math.atan2(E.imag, E.real)
            source = pandapower.create_bus(net, vn_kv=inverter.kV_base)
            pandapower.create_impedance(net, at, source, rft_pu=0.0, xft_pu=X_C, sn_mva=MVA)
            self.sources.append(pandapower.create_ext_grid(net, source))
            S_source = E * (S / V)
            inverter.P_MW, inverter.Q_Mvar = S_source.real * MVA, S_source.imag * MVA
            # Setpoints with which this is the steady state; a master overwrites them.
            inverter.f_set_Hz = HZ * (1 + inverter.K_P * S_source.real)
            inverter.v_set_kV = inverter.kV_base * (abs(E) + inverter.K_Q * S_source.imag)
        self.load = pandapower.create_load(net, number[LOAD_BUS], p_mw=0.0, q_mvar=0.0)
        self.options = {"init": "flat"}
        self.flow()
        self.options = {"init": "results", "recycle": RECYCLE}

    def flow(self):
        """What each source delivers, MVA."""
        net = self.net
        net.ext_grid["vm_pu"] = [inverter.v_kV / inverter.kV_base for inverter in self.inverters]
        net.ext_grid["va_degree"] = [math.degrees(inverter.angle) for inverter in self.inverters]
        net.load.loc[self.load, ["p_mw", "q_mvar"]] = (self.dP_MW, self.dQ_Mvar)
        pandapower.runpp(net, tolerance_mva=1e-9, numba=False, **self.options)
        return [complex(net.res_ext_grid.p_mw[s], net.res_ext_grid.q_mvar[s]) for s in self.sources]

    def do_step(self, current_time, step_size):
        count = max(1, math.ceil(step_size / SUBSTEP_S - 1e-9))
        h = step_size / count
        gain = -math.expm1(-OMEGA_C * h)
        for _ in range(count):
            for inverter, S in zip(self.inverters, self.flow()):
                inverter.angle += 2 * math.pi * (inverter.f_Hz - HZ) * h
                inverter.soc_percent -= 100 * S.real * h / 3600 / inverter.capacity_MWh
                inverter.P_MW += gain * (S.real - inverter.P_MW)
                inverter.Q_Mvar += gain * (S.imag - inverter.Q_Mvar)
        return True
