"""Viscoelastic, adhesive contact of a corrugated punch: tack tests by parallel Green's function molecular dynamics.

    import pgfmd
    scene = pgfmd.Scene("tri-tack", grid={"n": 48}, drive={"speed": "50 um/s", "preload": 2e-3})
    scene.check()                                   # scales, memory, cost, warnings
    found = pgfmd.simulate(scene)                   # in memory: found.curve, .measures, .fields
    pgfmd.run(scene, "out/mine", ranks=2)           # into a folder, with checkpoints
    results = pgfmd.load("out/mine")                # results.curve, .energy, .fields, .run

Importing pgfmd loads none of its parts, so that tools which only read results need no MPI.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .analysis.summary import analyse as analyse
    from .commands.check import report as check  # noqa: F401
    from .errors import PgfmdError as PgfmdError
    from .in_memory import simulate as simulate
    from .plots.folder import plot_results as plot_results
    from .results import load as load
    from .runner import run_scene as run_scene
    from .scene import Scene as Scene
    from .scene import load_scene as load_scene
    from .start import run as run

__version__ = "0.2.0"

_HOMES = {
    "Scene": "scene:Scene",
    "load_scene": "scene:load_scene",
    "check": "commands.check:report",
    "simulate": "in_memory:simulate",
    "run": "start:run",
    "run_scene": "runner:run_scene",
    "load": "results:load",
    "analyse": "analysis.summary:analyse",
    "plot_results": "plots.folder:plot_results",
    "PgfmdError": "errors:PgfmdError",
}
"""Where each name of the interface is defined: module and name."""

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        module, _, attribute = _HOMES[name].partition(":")
        return getattr(importlib.import_module(f"pgfmd.{module}"), attribute)
    raise AttributeError(f"module 'pgfmd' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
