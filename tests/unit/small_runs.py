"""Real runs small enough for a unit test, finished and stopped."""

import math
from pathlib import Path

from mpi4py import MPI

import pgfmd.runner
from pgfmd.errors import Stopped
from pgfmd.files.hdf5 import open_serial
from pgfmd.restart.checkpoint_policy import Timing
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene
from tests.stopper import StopAfter

SCENE = ("tri-tack", "grid.n=24", "drive.preload=1 mN", 'output.snapshots=["1 s"]')
"""About 70 steps, the preload at the 43rd; snapshots at 1 s, the preload, and the largest tension."""


def run(
    folder: Path, *changes: str, stop_after: float = math.inf, every: float = 600.0, stop_for: int = StopAfter.number
) -> Path:
    """Runs SCENE into a folder, until it is finished or has made so many steps; returns the folder. stop_for: number of
    a signal, or checkpoint_policy.OUT_OF_TIME."""
    source, *others = SCENE
    before, pgfmd.runner.StopSignals = pgfmd.runner.StopSignals, StopAfter
    StopAfter.steps, StopAfter.number = stop_after, stop_for
    try:
        scene = load_scene(source, [*others, *changes])
        run_scene(scene, MPI.COMM_SELF, folder, lambda line: None, Options(timing=Timing(every)))
    except Stopped:
        pass
    finally:
        pgfmd.runner.StopSignals = before
    return folder


def damage_an_array(path: Path, name: str = "state/traction") -> None:
    """Turns a bit in the data of an array of a checkpoint over."""
    with open_serial(path, "r") as file:
        start = file[name].id.get_offset()
    flip(path, start + 100)


def flip(path: Path, byte: int, bit: int = 0) -> None:
    """Turns a bit of a file over."""
    with open(path, "r+b") as file:
        file.seek(byte)
        old = file.read(1)[0]
        file.seek(byte)
        file.write(bytes([old ^ (1 << bit)]))
