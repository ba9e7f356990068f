"""The libraries at work: Case 1 gives the same numbers on every platform, and a panic stays inside."""

import plan
import pytest
from conftest import MODELS, PLATFORMS, library

# Their C libraries round sines and powers differently in the last bit, and the loop is stable.
TOLERANCE = 1e-9


@pytest.fixture(scope="module")
def case1(unpacked, drivers, tmp_path_factory):
    """`case1(platform)`: the columns' names and the rows of numbers."""
    folder = tmp_path_factory.mktemp("plans")
    done = {}

    def run(platform):
        if platform not in done:
            file = folder / f"{platform}.txt"
            libraries = {which: library(unpacked, which, platform) for which in MODELS}
            columns = plan.write(file, unpacked, libraries)
            printed = drivers(platform, "run", file)
            done[platform] = columns, [[float(word) for word in line.split()] for line in printed.splitlines()]
        return done[platform]

    return run


def test_case1_settles_on_linux64(case1):
    """So that equal numbers mean equal physics, and not the same nothing."""
    columns, rows = case1("linux64")
    assert len(rows) == 31 and all(len(row) == len(columns) for row in rows)
    at = {round(row[0]): dict(zip(columns, row)) for row in rows}
    deviation = {time: max(abs(at[time][f"grid.omega[{i}]"] - 1) for i in range(1, 8)) for time in at}
    assert deviation[20] > 1e-3, "before the controller droop alone lets the frequency sag"
    # Not to zero: the energy exchange, which goes on for minutes, keeps moving the powers.
    assert deviation[25] < 1e-2 * deviation[20], "the controller restores it within 5 s"
    assert abs(at[30]["grid.bus_V[12]"] - at[25]["grid.bus_V[12]"]) > 1e-3, "the load step is seen"


@pytest.mark.parametrize("platform", [platform for platform in PLATFORMS if platform != "linux64"])
def test_the_numbers_are_those_of_linux64(case1, platform):
    (columns, expected), (_, found) = case1("linux64"), case1(platform)
    assert len(found) == len(expected)
    worst, where = max(
        (abs(a - b), f"{column} at {row[0]} s")
        for row, other in zip(expected, found)
        for column, a, b in zip(columns, row, other)
    )
    print(f"{platform}: largest difference {worst:.1e}, {where}")
    assert worst <= TOLERANCE, f"{where}: {worst:.1e}"


@pytest.mark.parametrize("name", ["plain", *PLATFORMS])
def test_a_panic_stays_inside_the_library(built, drivers, tmp_path, name):
    """The mock model of the FMI tests panics while it loads 666; linked in the same way as the FMUs."""
    platform = "linux64" if name == "plain" else name
    mock = built / "mock" / name / f"Mock{PLATFORMS[platform]}"
    (tmp_path / "n.txt").write_text("666")
    assert drivers(platform, "panic", mock, tmp_path.as_uri()).strip() == "fenced"
