"""Viscoelastic, adhesive contact of a corrugated punch: tack tests by parallel Green's function molecular dynamics.

    import pgfmd
    scene = pgfmd.Scene("tri-tack", grid={"n": 48}, drive={"speed": "50 um/s", "preload": 2e-3})
    scene.check()                                   # scales, memory, cost, warnings
    found = pgfmd.simulate(scene)                   # in memory: found.curve, .measures, .fields
    pgfmd.plot_force(found)                         # a Figure of matplotlib
    pgfmd.run(scene, "out/mine", ranks=2)           # into a folder, with checkpoints
    results = pgfmd.load("out/mine")                # results.curve, .energy, .fields, .run
    table = pgfmd.study(scene, {"drive.speed": ["20 um/s", "50 um/s"]}, out="out/speeds")

Importing pgfmd loads none of its parts, so that tools which only read results need no MPI.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .analysis.comparison import compare
    from .analysis.pictures import (
        plot_bearing_area,
        plot_bulges,
        plot_comparison,
        plot_compliance,
        plot_hysteresis,
        plot_twin,
    )
    from .analysis.summary import analyse
    from .characterisation.rheology_table import fit_prony
    from .commands.check import check
    from .errors import PgfmdError
    from .in_memory import simulate
    from .plots.curves import plot_curve, plot_energy, plot_force, plot_time
    from .plots.cycles import plot_cycles
    from .plots.folder import plot_results
    from .plots.live import LivePlot
    from .plots.maps import plot_contact_maps, plot_stress_maps
    from .plots.movie import movie, plot_frame
    from .plots.numbers import plot_numbers
    from .plots.punch import plot_punch
    from .plots.rheology import plot_fit, plot_rheology
    from .plots.sites import plot_sites
    from .punch.export import export_punch
    from .reporting.report import report
    from .results import load
    from .results.status import status_of as status
    from .results.verify import verify
    from .runner import run_scene
    from .scene import Scene, load_scene, shipped_scenes, shipped_text
    from .start import run
    from .studies.extrapolation import plot_convergence
    from .studies.pictures import plot_study_curves, plot_study_numbers
    from .studies.study import converge, study

__version__ = "0.2.0"

_HOMES = {
    "Scene": "scene:Scene",
    "load_scene": "scene:load_scene",
    "shipped_scenes": "scene:shipped_scenes",
    "shipped_text": "scene:shipped_text",
    "check": "commands.check:check",
    "simulate": "in_memory:simulate",
    "run": "start:run",
    "run_scene": "runner:run_scene",
    "load": "results:load",
    "status": "results.status:status_of",
    "verify": "results.verify:verify",
    "analyse": "analysis.summary:analyse",
    "compare": "analysis.comparison:compare",
    "fit_prony": "characterisation.rheology_table:fit_prony",
    "report": "reporting.report:report",
    "study": "studies.study:study",
    "converge": "studies.study:converge",
    "plot_results": "plots.folder:plot_results",
    "plot_punch": "plots.punch:plot_punch",
    "export_punch": "punch.export:export_punch",
    "plot_force": "plots.curves:plot_force",
    "plot_time": "plots.curves:plot_time",
    "plot_curve": "plots.curves:plot_curve",
    "plot_numbers": "plots.numbers:plot_numbers",
    "plot_cycles": "plots.cycles:plot_cycles",
    "plot_energy": "plots.curves:plot_energy",
    "plot_contact_maps": "plots.maps:plot_contact_maps",
    "plot_stress_maps": "plots.maps:plot_stress_maps",
    "plot_sites": "plots.sites:plot_sites",
    "plot_frame": "plots.movie:plot_frame",
    "movie": "plots.movie:movie",
    "plot_comparison": "analysis.pictures:plot_comparison",
    "plot_bulges": "analysis.pictures:plot_bulges",
    "plot_compliance": "analysis.pictures:plot_compliance",
    "plot_hysteresis": "analysis.pictures:plot_hysteresis",
    "plot_twin": "analysis.pictures:plot_twin",
    "plot_bearing_area": "analysis.pictures:plot_bearing_area",
    "plot_study_curves": "studies.pictures:plot_study_curves",
    "plot_study_numbers": "studies.pictures:plot_study_numbers",
    "plot_convergence": "studies.extrapolation:plot_convergence",
    "plot_rheology": "plots.rheology:plot_rheology",
    "plot_fit": "plots.rheology:plot_fit",
    "LivePlot": "plots.live:LivePlot",
    "PgfmdError": "errors:PgfmdError",
}
"""Where each name of the interface is defined: module and name."""

__all__ = [
    "LivePlot",
    "PgfmdError",
    "Scene",
    "__version__",
    "analyse",
    "check",
    "compare",
    "converge",
    "export_punch",
    "fit_prony",
    "load",
    "load_scene",
    "movie",
    "plot_bearing_area",
    "plot_bulges",
    "plot_comparison",
    "plot_compliance",
    "plot_contact_maps",
    "plot_convergence",
    "plot_curve",
    "plot_cycles",
    "plot_energy",
    "plot_fit",
    "plot_force",
    "plot_frame",
    "plot_hysteresis",
    "plot_numbers",
    "plot_punch",
    "plot_results",
    "plot_rheology",
    "plot_sites",
    "plot_stress_maps",
    "plot_study_curves",
    "plot_study_numbers",
    "plot_time",
    "plot_twin",
    "report",
    "run",
    "run_scene",
    "shipped_scenes",
    "shipped_text",
    "simulate",
    "status",
    "study",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        module, _, attribute = _HOMES[name].partition(":")
        return getattr(importlib.import_module(f"pgfmd.{module}"), attribute)
    raise AttributeError(f"module 'pgfmd' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
