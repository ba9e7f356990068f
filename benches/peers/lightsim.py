"""The warm power flow in lightsim2grid, one load changed: the peer of `power-flow` in benches/grid.rs.

Prints one line of JSON. The fastest of lightsim2grid's Newton solvers with KLU counts, results per element switched
off, so that what is timed is what is compared: from a changed load to the voltages.
"""
import argparse
import json
import time
import warnings

import numpy as np
from lightsim2grid import AlgorithmType
from lightsim2grid.compilation_options import version
from lightsim2grid.network import init_from_matpower
from matpowercaseframes import CaseFrames


def warm(grid, bus_of_load, arguments, algorithm):
    grid.change_algorithm(algorithm)
    grid.deactivate_result_computation()
    start = np.array(arguments.start, dtype=complex)
    begin = time.perf_counter()
    v = grid.ac_pf(start.copy(), 20, arguments.tolerance)
    cold = time.perf_counter() - begin
    if v.shape[0] == 0:
        raise SystemExit("lightsim2grid found no solution")
    first = v.copy()
    load = next(l for l in grid.get_loads() if l.bus_id == bus_of_load)
    p, q = load.target_p_mw, load.target_q_mvar
    times = []
    for k in range(arguments.solves):
        factor = arguments.factor if k % 2 == 0 else 1.0
        begin = time.perf_counter()
        grid.change_p_load(load.id, p * factor)
        grid.change_q_load(load.id, q * factor)
        v = grid.ac_pf(v, 20, arguments.tolerance)
        times.append(time.perf_counter() - begin)
    return first, cold, times, grid.get_algo().get_nb_iter()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("case")
    parser.add_argument("--bus", type=int, required=True)
    parser.add_argument("--factor", type=float, default=1.1)
    parser.add_argument("--solves", type=int, default=101)
    parser.add_argument("--tolerance", type=float, default=1e-8)
    parser.add_argument("--voltages", help="file with lines `id vm va` to compare with")
    arguments = parser.parse_args()

    warnings.simplefilter("ignore")
    frames = CaseFrames(arguments.case)
    bus = frames.bus.to_numpy(dtype=float)
    ids = bus[:, 0].astype(int)
    arguments.start = bus[:, 7] * np.exp(1j * np.radians(bus[:, 8]))
    at = int(np.flatnonzero(ids == arguments.bus)[0])
    best = None
    for name in ("NR_KLU", "NRSing_KLU"):
        grid = init_from_matpower(frames)
        first, cold, times, iterations = warm(grid, at, arguments, getattr(AlgorithmType, name))
        median = float(np.median(times))
        if best is None or median < best["median_s"]:
            best = {"algorithm": name, "median_s": median, "warm_s": times, "cold_s": cold,
                    "warm_iterations": iterations}
    best["version"] = version
    if arguments.voltages:
        ours = np.loadtxt(arguments.voltages)
        if not np.array_equal(ours[:, 0].astype(int), ids):
            raise SystemExit("the buses to compare are others")
        live = ours[:, 1] > 0
        difference = ours[:, 1] * np.exp(1j * ours[:, 2]) - first
        best["difference_pu"] = float(np.abs(difference[live]).max())
    print(json.dumps(best))


if __name__ == "__main__":
    main()
