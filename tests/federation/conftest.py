"""`bess` as processes that are watched, beside the broker and library of the helics wheel of this environment."""

import itertools
import os
import pathlib
import signal
import socket
import subprocess
import sys
import time

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("BESS_RELEASE_DIR", ROOT / "target/release")) / "bess"
# The python3 of this environment comes first, as it would for a user who has activated it.
ENVIRONMENT = {**os.environ, "PATH": f"{pathlib.Path(sys.executable).parent}:{os.environ['PATH']}"}
ENVIRONMENT.pop("BESS_HELICS", None)


class Process:
    """One `bess`, whose output is kept in files, so that nobody waits for a reader."""

    def __init__(self, arguments, folder, prefix=()):
        assert PROGRAM.is_file(), f"{PROGRAM} is missing: run `cargo xtask fmu` first"
        self.said = folder / f"said-{time.monotonic_ns()}.txt"
        with open(self.said, "wb") as said:
            command = [*prefix, str(PROGRAM), *map(str, arguments)]
            # Whoever starts the tests in the background has Ctrl-C ignored, and would hand that on.
            self.process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                env=ENVIRONMENT,
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            )

    def wait(self, seconds=60):
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise AssertionError(f"still there after {seconds} s:\n{self.text()}") from None

    def text(self):
        """What it said, in one line, without the frame that errors are printed in."""
        return " ".join(self.said.read_text(errors="replace").replace("\u2502", " ").split())


@pytest.fixture
def start(tmp_path):
    """`start(arguments...)` starts `bess` in a folder of its own; what is left at the end is ended."""
    started = []

    def run(*arguments, prefix=()):
        started.append(Process(arguments, tmp_path, prefix))
        return started[-1]

    yield run
    for one in started:
        if one.process.poll() is None:
            one.process.kill()
            one.process.wait()


@pytest.fixture
def bess(start):
    """`bess(arguments...)` runs it to its end."""

    def run(*arguments, code=0):
        done = start(*arguments)
        assert done.wait() == code, done.text()
        return done.text()

    return run


PORTS = itertools.count(os.getpid() % 100 * 64)


def free_port():
    """A port with room behind it, which the federates take, below those that systems give to anybody."""
    while True:
        first = 5000 + next(PORTS) * 64 % 6400
        sockets = []
        try:
            for port in range(first, first + 32):
                sockets.append(socket.socket())
                sockets[-1].bind(("127.0.0.1", port))
            return first
        except OSError:
            continue
        finally:
            for one in sockets:
                one.close()


def processes(folder):
    """Command lines, by number, of all processes of `bess` that work in this folder."""
    found = {}
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
            here = os.readlink(entry / "cwd") == str(folder)
        except OSError:
            continue
        if here and words[0].endswith("/bess"):
            found[int(entry.name)] = words[1:]
    return found


def federate(folder, name, seconds=20):
    """Number of the process that runs this federate."""
    return until(
        lambda: next(
            (
                number
                for number, words in processes(folder).items()
                if f"--federate {name} " in " ".join(words) + " " and "--bury" not in words
            ),
            None,
        ),
        seconds,
        f"a process of {name}",
    )


def until(found, seconds, what):
    """Waits until `found()` gives something true."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if result := found():
            return result
        time.sleep(0.01)
    raise AssertionError(f"no {what} within {seconds} s")


def reached(trajectory):
    """Time of the last whole row, s; -1 before there is one."""
    try:
        *_, last = (line for line in trajectory.read_text().splitlines(keepends=True)[1:] if line.endswith("\n"))
    except (OSError, ValueError):
        return -1.0
    return float(last.split(",")[0])


def rows(trajectory):
    """(names, [[value, ...], ...]) of a trajectory."""
    header, *lines = trajectory.read_text().splitlines()
    return header.split(","), [list(map(float, line.split(","))) for line in lines]


def kill(number):
    os.kill(number, signal.SIGKILL)
