"""Viscoelastic, adhesive contact of a corrugated punch: tack tests by parallel Green's function molecular dynamics.

    import pgfmd
    results = pgfmd.load("out/tri-tack")        # results.curve, .energy, .fields, .run
    scene = pgfmd.load_scene("tri-tack", ["grid.n=512"])
    pgfmd.run_scene(scene, comm, "out/mine")    # comm: an mpi4py communicator

Importing pgfmd loads none of its parts, so that tools which only read results need no MPI.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "load": "results",
    "load_scene": "scene",
    "run_scene": "runner",
    "plot_results": "plots.folder",
    "analyse": "analysis.summary",
    "PgfmdError": "errors",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"pgfmd.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'pgfmd' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
