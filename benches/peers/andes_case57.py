"""Seven droop-controlled grid-forming inverters (REGF1) on the IEEE 57-bus case in ANDES: the peer of Case 1.

A load change on the way, ANDES' own default step and settings. Only the time of the simulation itself counts; reading
the case, building the equations and the power flow do not. Prints one line of JSON.
"""
import argparse
import contextlib
import io
import json
import sys
import time

import andes
import numpy as np


def system(case, stop_s):
    ss = andes.load(case, setup=False, no_output=True)
    generators = [(model, k) for model in (ss.Slack, ss.PV) for k in range(model.n)]
    for number, (model, k) in enumerate(generators, 1):
        # Room for its power, as REGF1 limits itself to its rating; the slack's is known after the power flow.
        mva = 1000.0 if model is ss.Slack else max(200.0, 150.0 * abs(model.p0.v[k]))
        ss.add("REGF1", {"idx": f"REGF1_{number}", "bus": model.bus.v[k], "gen": model.idx.v[k], "Sn": mva})
    load = ss.PQ.idx.v[ss.PQ.bus.v.index(12)]
    # Loads are admittances by default: bus 12 draws a tenth more active power, then what it drew before.
    for at, amount in ((0.4 * stop_s, 1.1), (0.7 * stop_s, 1 / 1.1)):
        ss.add("Alter", {"t": at, "model": "PQ", "dev": load, "src": "Req", "attr": "v", "method": "*", "amount": amount})
    ss.setup()
    ss.PFlow.run()
    if not ss.PFlow.converged:
        raise SystemExit("ANDES found no power flow")
    ss.TDS.config.tf = stop_s
    ss.TDS.config.no_tqdm = 1
    return ss


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("case")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=10.0)
    arguments = parser.parse_args()
    andes.config_logger(50)
    times, steps, moved = [], 0, 0.0
    with contextlib.redirect_stdout(io.StringIO()):
        for _ in range(arguments.runs + 1):
            ss = system(arguments.case, arguments.seconds)
            ss.TDS.init()
            begin = time.perf_counter()
            done = ss.TDS.run()
            times.append(time.perf_counter() - begin)
            reached = float(ss.dae.ts.t[-1])
            if not done or reached < arguments.seconds - 1e-6:
                raise SystemExit(f"ANDES stopped at {reached} s")
            steps = len(ss.dae.ts.t)
            moved = float(np.ptp(ss.dae.ts.x, axis=0).max())
    if moved < 1e-6:
        raise SystemExit("nothing moved: the load change was not applied")
    # The first run compiles.
    per_second = [t / arguments.seconds for t in times[1:]]
    print(json.dumps({"version": andes.__version__, "wall_per_second": per_second, "steps": steps, "largest_move": moved}))


if __name__ == "__main__":
    sys.exit(main())
