"""A bearing-area model beside a run: predictions for its punch, preload and speed, in the table of its analysis."""

from __future__ import annotations

from pgfmd.errors import ResultError
from pgfmd.files.storage import SCENE_FILE
from pgfmd.results import Results
from pgfmd.results.curve import Measures, measure
from pgfmd.scene import load_scene

from .bearing_area import Prediction, asperity_remarks, laws_of, predict
from .summits import summits_of
from .table import Table

SECTION = "Bearing-area model"


def predictions_for(results: Results, preload: float, asperity: Results | None = None) -> list[Prediction]:
    """What a bearing-area model says of a run's punch under a preload [N], one prediction a law.

    Raises:
        ResultError: if the face has no summits, or the asperity's run is none.
    """
    scene = load_scene(results.directory / SCENE_FILE)
    try:
        summits = summits_of(scene)
        laws = laws_of(scene, asperity)
        return [predict(summits, law, preload, f"bearing area, {name}") for name, law in laws.items()]
    except (ValueError, OSError) as problem:
        raise ResultError(f"{results.directory}: no bearing-area model: {problem}") from problem


def add_bearing_area(
    table: Table, results: Results, found: Measures, asperity: Results | None = None
) -> list[Prediction]:
    """Predict, and add rows to the table: of each law what it says, and how that compares with the run."""
    preload = found.preload if found.preload is not None else found.largest_force
    if preload is None or preload <= 0.0:
        raise ResultError(f"{results.directory}: no bearing-area model: the run has no compressive force yet")
    predictions = predictions_for(results, preload, asperity)
    first = predictions[0]
    table.add(SECTION, "summits", "summits", first.summits, "", f"{first.touched} of them touched")
    for prediction in predictions:
        own, name = measure(prediction.loop), prediction.law.removeprefix("bearing area, ")
        key = "bearing_" + name.lower().replace(" ", "_")
        pairs = (
            ("pull_off_force", "pull-off force", _tension(own.pull_off), _tension(found.pull_off), "N"),
            ("snap_in_force", "snap-in force", _tension(own.snap_in), _tension(found.snap_in), "N"),
            ("work_of_separation", "work of separation", own.work_of_separation, found.work_of_separation, "J"),
            ("hysteresis", "hysteresis", own.hysteresis, found.hysteresis, "J"),
        )
        for suffix, title, value, full, unit in pairs:
            note = f"{value / full:.3g} times the run's" if value is not None and full else ""
            table.add(SECTION, f"{key}_{suffix}", f"{name}: {title}", value, unit, note)
    if asperity is not None:
        scene = load_scene(results.directory / SCENE_FILE)
        table.remarks += asperity_remarks(asperity, results.scene, summits_of(scene), preload)
    return predictions


def _tension(dip) -> float | None:
    return None if dip is None else dip.tension
