"""A command of pgfmd in a process of its own, forked from this one: nothing is imported twice, nothing outlives it."""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from .faults import Fault

GRACE = 60.0
"""Time [s] that a run which is asked to stop has for a checkpoint."""
MEMORY = 6 * 2**30
"""Bytes of address space that a process may have: no scene here needs more, and the machine is spared."""

OUT_OF_TIME = "out of time"


@dataclass
class Ended:
    """How a process ended: outcome in a word, processor time [s], faults, and what it said."""

    outcome: str
    cost: float
    faults: list[Fault] = field(default_factory=list)
    said: str = ""


def spare_memory() -> None:
    """Limits what this process and its children may allocate."""
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY if hard < 0 else min(MEMORY, hard), hard))


def in_child(action: Callable[[], tuple[str, list[Fault]]], folder: Path, limit: float) -> Ended:
    """Runs an action in a forked process, in a folder of its own, where `said` holds what it prints.

    action: returns an outcome in a word, and faults. After `limit` [s] it gets TERM, as from a batch system, and after
    GRACE more KILL, which is a fault. This process must not have loaded MPI.
    """
    if "mpi4py.MPI" in sys.modules:
        raise RuntimeError("MPI is loaded, and a fork of a process with MPI can't use it")
    folder.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    child = os.fork()
    if child == 0:
        _be_child(action, folder)
    try:
        killed, status, cost = _wait(child, began, limit)
    except BaseException:
        # Ctrl-C: no run outlives this process.
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    said = (folder / "said").read_text(encoding="utf-8", errors="replace") if (folder / "said").exists() else ""
    report = folder / "report.json"
    if killed:
        return Ended("hung", cost, [Fault("hangs: TERM was not answered", said[-300:])], said)
    if not report.exists():
        code = os.waitstatus_to_exitcode(status)
        if code == -signal.SIGTERM and time.monotonic() - began >= limit:
            # Between two commands, where nobody listens.
            return Ended(OUT_OF_TIME, cost, [], said)
        return Ended("died", cost, [Fault(f"the process died of {code}", said[-300:])], said)
    outcome, faults = json.loads(report.read_text(encoding="utf-8"))
    return Ended(outcome, cost, [Fault(**one) for one in faults], said)


def _wait(child: int, began: float, limit: float) -> tuple[bool, int, float]:
    """(whether it had to be killed, status, processor time [s]) of a child."""
    asked, killed = None, False
    while True:
        found, status, used = os.wait4(child, 0 if killed else os.WNOHANG)
        if found:
            return killed, status, used.ru_utime + used.ru_stime
        now = time.monotonic()
        if asked is None and now - began > limit:
            asked = now
            os.kill(child, signal.SIGTERM)
        if asked is not None and now - asked > GRACE:
            killed = True
            os.kill(child, signal.SIGKILL)
        time.sleep(0.01)


def _be_child(action: Callable[[], tuple[str, list[Fault]]], folder: Path) -> None:
    """What the child does; it never returns."""
    code = 1
    try:
        spare_memory()
        file = os.open(folder / "said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, 1)
        os.dup2(file, 2)
        os.chdir(folder)
        outcome, faults = action()
        report = [outcome, [asdict(fault) for fault in faults]]
        temporary = folder / "report.part"
        temporary.write_text(json.dumps(report), encoding="utf-8")
        temporary.rename(folder / "report.json")
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def pgfmd(*arguments: str) -> tuple[int, str]:
    """(exit code, what was said) of a command, in this process, whose stdout and stderr are the file `said`.

    An exception that reaches Python's top ends in its traceback and code 1, as it would on the command line.
    """
    from pgfmd.cli import main

    sys.stdout.flush()
    start = os.fstat(1).st_size
    code: Any = 1
    try:
        main(list(arguments))
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    with open("said", "rb") as file:
        file.seek(start)
        said = file.read().decode("utf-8", errors="replace")
    return (code if isinstance(code, int) else 0 if code is None else 1), said


NEEDED = (
    "h5netcdf", "pandas", "scipy.fft", "scipy.interpolate", "scipy.ndimage", "scipy.optimize", "xarray",
    "pgfmd.analysis.summary", "pgfmd.results.verify", "pgfmd.schemes.gfmd.kernels", "pgfmd.solver.kernels",
    "pgfmd.schemes.quasistatic.stability_kernels", "pgfmd.solver.transform_kernels",
)  # fmt: skip
"""Modules that a run or its judges load, none of which loads MPI."""


def warm_up() -> None:
    """Loads what every run needs, so that no child has to."""
    for name in NEEDED:
        importlib.import_module(name)
    from pgfmd.scene import load_scene

    load_scene("tri-tack")
