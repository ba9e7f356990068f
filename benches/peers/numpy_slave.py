"""The controller of Case 1 in NumPy, to be made into an FMU by PythonFMU: what benches/peer_c/peer.c is in C.

Seven agents, one graph, the sampled law of docs/paper.md; all edges and all five quantities at once. Variables in the
order of modelDescription/BessConsensus.xml, so that the value reference of each is one less than there.
"""

import numpy as np
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real

N = 7
K_P = np.array([0.004, 0.0048, 0.005, 0.0036, 0.0038, 0.00408, 0.0044])
K_Q = np.array([0.02, 0.0242, 0.026, 0.0246, 0.019, 0.0212, 0.0226])
CAPACITY = 0.5 * K_P[0] / K_P
OMEGA_SET_START = np.array([1.0015, 0.999, 1.0005, 0.9985, 1.001, 0.9995, 1.0])
V_SET_START = 1.02
P_EXCHANGE_MAX = 1.0
GAIN_E = 0.003  # the other gains are 1
THETA_E, FADE = 1.0, 2.0
EDGES = np.array([(0, 1), (0, 6), (1, 2), (3, 4), (4, 5), (5, 6)])
WEIGHTS = np.array([1.0, 0.3721517199979191, 0.4729300730786073, 0.37587253293781075, 0.6039036919833249, 0.41901320721271484])
PINNED = np.array([0, 6])

INCIDENCE = np.zeros((N, len(EDGES)))
INCIDENCE[EDGES[:, 0], range(len(EDGES))] = 1.0
INCIDENCE[EDGES[:, 1], range(len(EDGES))] = -1.0
PEERS = np.abs(INCIDENCE).sum(axis=1)
DEGREE = PEERS + np.isin(range(N), PINNED)
SHARE = 1.0 / (1.0 + DEGREE[EDGES].max(axis=1))
PIN_SHARE = 1.0 / (1.0 + DEGREE[PINNED])
EXCHANGE_CAP = 3600.0 * CAPACITY[EDGES].min(axis=1) / (1.0 + PEERS[EDGES].max(axis=1))
EXCHANGE_LIMIT = (P_EXCHANGE_MAX / PEERS)[EDGES].min(axis=1)
# Rows: omega, p, V, q, state of charge.
LAWS = np.outer([1.0, 1.0, 1.0, 1.0, 3600.0 * GAIN_E], WEIGHTS)


def flow(law, d, cap):
    """sgn(d) min(g w sqrt(abs(d)), cap abs(d)): eta is 1/2."""
    size = np.abs(d)
    return np.copysign(np.minimum(law * np.sqrt(size), cap * size), d)


class NumpyConsensus(Fmi2Slave):
    author = "benches of bess-consensus"
    description = "The controller of Case 1 in NumPy"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.measured = {name: np.zeros(N) for name in ("P", "Q", "V", "omega", "E")}
        self.omega_ref = self.V_ref = 1.0
        self.P_ref = 0.0
        self.enable = self.dispatch = False
        self.available, self.topology = [True] * N, 1
        self.setpoints = {
            "omega_set": OMEGA_SET_START.copy(),
            "V_set": np.full(N, V_SET_START),
            "P_set": np.zeros(N),
            "Q_set": np.zeros(N),
        }
        self.flows = np.zeros(len(EDGES))
        self.fade_left = FADE
        for name, values in self.measured.items():
            self.connect_array(Real, name, values, Fmi2Causality.input)
        for name in ("omega_ref", "V_ref", "P_ref"):
            self.connect(Real, name, Fmi2Causality.input)
        for name in ("enable", "dispatch"):
            self.connect(Boolean, name, Fmi2Causality.input)
        self.connect_array(Boolean, "available", self.available, Fmi2Causality.input)
        self.connect(Integer, "topology", Fmi2Causality.input)
        for name, values in self.setpoints.items():
            self.connect_array(Real, name, values, Fmi2Causality.output)

    def connect(self, kind, name, causality):
        # As an attribute of this object: what PythonFMU reads and sets by itself.
        self.register_variable(kind(name, causality=causality, variability=variability(kind)))

    def connect_array(self, kind, name, values, causality):
        for i in range(N):
            self.register_variable(
                kind(
                    f"{name}[{i + 1}]",
                    causality=causality,
                    variability=variability(kind),
                    getter=lambda i=i: values[i],
                    setter=lambda value, i=i: values.__setitem__(i, value),
                )
            )

    def do_step(self, current_time, step_size):
        if self.enable:
            self.advance(step_size)
        return True

    def advance(self, h):
        m, s = self.measured, self.setpoints
        x = np.array(
            [m["omega"], K_P * (m["P"] - s["P_set"]), m["V"], K_Q * (m["Q"] - s["Q_set"]), m["E"] / CAPACITY]
        )
        cap = np.empty((5, len(EDGES)))
        cap[:4] = SHARE / h
        cap[4] = EXCHANGE_CAP / max(h, THETA_E)
        f = flow(LAWS, x @ INCIDENCE, cap)
        exchange = np.clip(f[4], -EXCHANGE_LIMIT, EXCHANGE_LIMIT)
        fade = 1.0 if h >= self.fade_left else h / self.fade_left
        self.flows += fade * (exchange - self.flows)
        self.fade_left = max(0.0, self.fade_left - h)
        u_omega, u_p, u_V, u_q = -(f[:4] @ INCIDENCE.T)
        u_omega[PINNED] -= flow(1.0, x[0, PINNED] - self.omega_ref, PIN_SHARE / h)
        u_V[PINNED] -= flow(1.0, x[2, PINNED] - self.V_ref, PIN_SHARE / h)
        if self.dispatch:
            u_p[PINNED] -= flow(1.0, x[1, PINNED] - self.P_ref, PIN_SHARE / h)
        s["omega_set"] += h * (u_omega + u_p)
        s["V_set"] += h * (u_V + u_q)
        s["P_set"][:] = INCIDENCE @ self.flows


def variability(kind):
    return Fmi2Variability.continuous if kind is Real else Fmi2Variability.discrete
