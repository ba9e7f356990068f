"""The grid FMU against trajectories of the same model from an independent solver (integrated to 1e-11)."""

import itertools
import json

import numpy as np
import pytest

TOLERANCE = 1e-6
QUANTITIES = ["P", "Q", "V", "omega", "E"]

# Irregular lengths, which do not divide a sample interval of 0.1 s.
IRREGULAR = [0.0103, 0.0005, 0.0371, 0.0229, 1e-6]


@pytest.fixture(params=["grid_islanded", "grid_tie"])
def case(request, reference):
    return json.loads((reference / f"{request.param}.json").read_text())


@pytest.mark.parametrize("lengths", [[0.01], [0.1], [0.025], IRREGULAR], ids=["10ms", "100ms", "25ms", "irregular"])
def test_trajectory(grid, case, lengths):
    assert worst(replay(grid, case, lengths)) < TOLERANCE


def test_start_time_does_not_matter(make, case):
    first = replay(make("grid"), case, [0.01], stop=4.0)
    for start in [-7.0, 1e5]:
        again = replay(make("grid"), case, [0.01], start=start, stop=4.0)
        for a, b in zip(first, again):
            assert np.abs(a[1] - b[1]).max() < 1e-12


def replay(grid, case, lengths, start=0.0, stop=None):
    """Runs a case; [(time, found, expected)] at its samples, in the order of QUANTITIES."""
    given, at = case["start"], case["grid"]
    grid.initialize(
        {
            **{q: at[q] for q in ["K_P", "K_Q", "X_c", "omega_c"]},
            **{q: given[q] for q in ["omega_set", "V_set", "tie_closed"]},
            "E_start": given["E"],
            "P_set": 0.0,
            "Q_set": 0.0,
        },
        start=start,
    )
    loads = {}
    schedule = list(case["schedule"])
    rows, time = [], 0.0
    for sample in case["samples"]:
        if stop is not None and sample["t"] > stop:
            break
        advance(grid, time, sample["t"], start, lengths)
        time = sample["t"]
        while schedule and schedule[0]["at"] <= time + 1e-9:
            for name, value in schedule.pop(0)["set"].items():
                if name.startswith(("dP_load", "dQ_load")):
                    # The schedule holds changes, the input is the total.
                    value = loads[name] = loads.get(name, 0.0) + value
                grid.set(name, value)
        found = np.concatenate([grid.get(q) for q in QUANTITIES])
        rows.append((time, found, np.concatenate([sample[q] for q in QUANTITIES])))
    if stop is None:
        assert not schedule, "every event was due"
    return rows


def advance(grid, begin, end, start, lengths):
    """Steps from one sample to the next in the given lengths, the last cut to fit."""
    for length in itertools.cycle(lengths):
        left = end - begin
        if left < 1e-12:
            return
        length = left if left < length * (1 + 1e-9) else length
        grid.step(start + begin, length)
        begin += length


def worst(rows):
    """The largest deviation, with its place in the assertion's message."""
    assert len(rows) > 100
    time, found, expected = max(rows, key=lambda row: np.abs(row[1] - row[2]).max())
    deviation = np.abs(found - expected)
    print(f"worst {deviation.max():.2e} at t = {time}, {QUANTITIES[deviation.argmax() // (len(found) // 5)]}")
    return deviation.max()
