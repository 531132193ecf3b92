"""A bearing-area model like that of Fuller and Tabor: every summit is an independent asperity, and forces are added.

    F(d) = sum_i F_1(-d - z_i; R_i)

The summits' heights z_i and radii R_i come from the punch's face; F_1 is one of `asperity_laws`. The programme is that
of the full run: approach at its speed to the preload, and retraction at its speed until the last asperity has detached.
The displacement d of the punch is also that of the full run. But asperities do not interact: each has its own
half-space. The model does not include saddles, the rim, or the positions of asperities. The paper doubts that it can
describe nominally flat contacts; here its curve can be compared with the full one.

Source: K. N. G. Fuller, D. Tabor, Proc. R. Soc. A 345 (1975) 327, doi:10.1098/rspa.1975.0138.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files.storage import SCENE_FILE
from pgfmd.physics.adhesion.registry import law_of
from pgfmd.results import Results
from pgfmd.results.curve import Array, Dip, Loop, Measures, measure
from pgfmd.scene import load_scene
from pgfmd.scene_objects import machine_compliance, series_of
from pgfmd.units import parse_quantity

from .asperity_laws import JkrAsperity, MeasuredAsperity, ViscoelasticAsperity
from .crack_law import CrackLaw
from .scene_differences import differences
from .summits import Summits, summits_of
from .table import Table

APPROACH_ROWS, RETRACTION_ROWS = 801, 2001
SAME_RADIUS = 1e-3
"""Radii are rounded to this fraction, so that similar summits share one law."""
MOST_DOUBLINGS = 40
PRELOAD_TOLERANCE = 1e-9
SECTION = "Bearing-area model"


class AsperityLaw(Protocol):
    """Force of one asperity; see `asperity_laws`."""

    @property
    def radius(self) -> float: ...

    def approach(self, depth: Array) -> Array: ...

    def retraction(self, depth: Array, turn: float) -> Array: ...


@dataclass(frozen=True, eq=False)
class Prediction:
    """The prediction for a punch: its loop, the law, the number of summits, and how many of them touched."""

    law: str
    loop: Loop
    summits: int
    touched: int


def predict(summits: Summits, law_for: Callable[[float], AsperityLaw], preload: float, name: str) -> Prediction:
    """The loop of independent asperities under a preload.

    Args:
        summits: at least one.
        law_for: gives the law of a summit with radius R [m]; called once for each different radius.
        preload: [N], above zero. name: of the law.

    Raises:
        ValueError: if there are no summits, or a preload that they can't reach.
    """
    if not len(summits):
        raise ValueError("the face has no summits: a bearing-area model has nothing to add up")
    laws = {key: law_for(radius) for key, radius in _radii(summits).items()}
    groups = _groups(summits)
    first = min(height for _, height in groups)
    deepest = _depth_at(laws, groups, first, preload)
    approach_depths = np.linspace(0.0, deepest, APPROACH_ROWS)
    pressed = _approach(laws, groups, approach_depths + first)
    furthest = _reach_out(laws, groups, first + deepest)
    retraction_depths = np.linspace(first + deepest, furthest, RETRACTION_ROWS)
    pulled = _retraction(laws, groups, retraction_depths, first + deepest)
    indentation = np.concatenate((approach_depths + first, retraction_depths[1:]))
    rows = len(indentation)
    unknown = np.full(rows, np.nan)
    phase = np.where(np.arange(rows) < APPROACH_ROWS, "approach", "retract")
    force = np.concatenate((pressed, pulled[1:]))
    loop = Loop(name, unknown, -indentation, force, unknown, unknown, phase, np.zeros(rows, bool))
    touched = sum(count for (_, height), count in groups.items() if height <= first + deepest)
    return Prediction(name, loop, len(summits), touched)


def _key(radius: float) -> float:
    return round(math.log(radius) / SAME_RADIUS)


def _radii(summits: Summits) -> dict[float, float]:
    return {_key(float(radius)): float(radius) for radius in summits.radius}


def _groups(summits: Summits) -> dict[tuple[float, float], int]:
    """Number of summits of each kind: key of the radius, and the depth d = -indentation at which it touches [m]."""
    groups: dict[tuple[float, float], int] = {}
    for height, radius in zip(summits.height, summits.radius, strict=True):
        # Heights of a periodic face differ by rounding.
        kind = _key(float(radius)), round(float(height), 15)
        groups[kind] = groups.get(kind, 0) + 1
    return groups


def _approach(laws: dict, groups: dict, indentation: Array) -> Array:
    """Sum over the asperities during the approach, at increasing indentations [m]."""
    return sum(count * laws[key].approach(indentation - height) for (key, height), count in groups.items())


def _retraction(laws: dict, groups: dict, indentation: Array, turn: float) -> Array:
    return sum(
        count * laws[key].retraction(indentation - height, turn - height) for (key, height), count in groups.items()
    )


def _depth_at(laws: dict, groups: dict, first: float, preload: float) -> float:
    """Depth below the first touch [m] at which the approach reaches the preload: doubled until it is exceeded, then by
    bisection."""

    def force(depth: float) -> float:
        return float(_approach(laws, groups, np.array([0.0, depth]) + first)[-1])

    deep = 1e-9
    for _ in range(MOST_DOUBLINGS):
        if force(deep) >= preload:
            break
        deep *= 2.0
    else:
        raise ValueError(f"the summits never carry the preload of {preload:.4g} N")
    shallow = 0.0
    while deep - shallow > PRELOAD_TOLERANCE * deep:
        middle = 0.5 * (shallow + deep)
        shallow, deep = (shallow, middle) if force(middle) >= preload else (middle, deep)
    return deep


def _reach_out(laws: dict, groups: dict, turn: float) -> float:
    """An indentation [m] at which every asperity has detached."""
    far = 1e-7
    for _ in range(MOST_DOUBLINGS):
        probe = np.linspace(turn, turn - far, 65)
        force = _retraction(laws, groups, probe, turn)
        if not np.any(force[-16:]):
            return float(probe[min(int(np.flatnonzero(force)[-1]) + 2, 64)])
        far *= 1.5
    raise ValueError("the asperities never let go")


def laws_of(scene: Any, asperity: Results | None = None) -> dict[str, Callable[[float], AsperityLaw]]:
    """The laws that are available for a scene, by name; each is a function of the summit's radius [m].

    "JKR" always; "JKR with crack speed" where the elastomer is viscous; "single asperity" where there is a run of one.

    Raises:
        ResultError: if the asperity's run does not belong to this scene.
    """
    modulus, energy = scene.substrate.contact_modulus, scene.adhesion.work_of_adhesion
    laws: dict[str, Callable[[float], AsperityLaw]] = {"JKR": lambda radius: JkrAsperity(radius, modulus, energy)}
    series, drive = series_of(scene.rheology), scene.drive
    if series.elements and scene.adhesion.attractive:
        crack = CrackLaw(series, modulus, energy, law_of(scene.adhesion).strength)
        speeds = drive.speed, drive.retract_speed
        laws["JKR with crack speed"] = lambda radius: ViscoelasticAsperity(radius, modulus, energy, crack, *speeds)
    if asperity is not None:
        known = _asperity_of(asperity)
        laws["single asperity"] = lambda radius: dataclasses.replace(known, radius=radius)
    return laws


def _asperity_of(results: Results) -> MeasuredAsperity:
    punch = results.scene.get("punch", {})
    if punch.get("pattern") != "sphere":
        found = punch.get("pattern", "no pattern")
        raise ResultError(
            f"{results.directory}: expected the run of one asperity, punch.pattern = sphere, found {found}; "
            "run the same scene with --set punch.pattern=sphere and the summits' radius as punch.curvature_radius"
        )
    loop = Loop.of(results)
    if not loop.retracted:
        raise ResultError(f"{results.directory}: the asperity's run has no retraction yet; let it finish")
    return MeasuredAsperity(parse_quantity(punch["curvature_radius"], "length"), loop)


def asperity_remarks(asperity: Results, scene: dict, summits: Summits, preload: float) -> list[str]:
    """Differences between the run of one asperity and the punch: material, adhesion, speed, radius, preload."""
    found = differences(scene, asperity.scene, ("rheology", "adhesion", "drive"), ("preload", "turn_time", "clearance"))
    remarks = [f"{key} differs: {mine} here, {its} in the asperity's run" for key, mine, its in found]
    known = _asperity_of(asperity)
    typical = float(np.median(summits.radius))
    if abs(known.radius - typical) > 0.02 * typical:
        remarks.append(f"radii differ: {typical:.4g} m here, {known.radius:.4g} m in the asperity's run")
    share = preload / len(summits)
    reached = known.loop.preload
    if abs(reached - share) > 0.1 * share:
        text = f"preload of one asperity: {reached:.4g} N in its run, {share:.4g} N = preload/{len(summits)} here"
        remarks.append(text)
    return remarks


def machine_remarks(scene: Any) -> list[str]:
    """Differences between the machine of the model, which is rigid, and that of a scene."""
    if not (machine_compliance(scene) or scene.drive.controls_load):
        return []
    here = "controls the force" if scene.drive.controls_load else "has a spring"
    return [
        f"bearing area: its asperities are on a rigid machine, and let go at drive.speed; the run's machine {here}, so "
        "compare forces, but not the work or the hysteresis"
    ]


def predictions_for(results: Results, preload: float, asperity: Results | None = None) -> list[Prediction]:
    """Predictions of a bearing-area model for a run's punch under a preload [N], one for each law.

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
    """Adds the predictions of each law, and their comparison with the run, to the table."""
    preload = found.preload if found.preload is not None else found.largest_force
    if preload is None or preload <= 0.0:
        raise ResultError(f"{results.directory}: no bearing-area model: the run has no compressive force yet")
    predictions = predictions_for(results, preload, asperity)
    table.remarks += machine_remarks(load_scene(results.directory / SCENE_FILE))
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


def _tension(dip: Dip | None) -> float | None:
    return None if dip is None else dip.tension
