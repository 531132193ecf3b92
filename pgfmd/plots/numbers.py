"""Measured numbers of several runs against a key of their scenes, or against another number, with error bars.

Runs that differ in further keys are separate lines. Reads files only, no MPI.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.results.curve import Measures, measure
from pgfmd.results.reading import Results, Run
from pgfmd.units import handy

from .curves import at_foot, labelled, opened_together
from .drawing import LINES, PALETTE, literal, new_figure, picture, place_ticks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKERS = "osD^vP"
FOLLOW = ("adhesion.q_ref", "adhesion.range", "drive.turn_time", "drive.clearance", "drive.retract_speed",
          "punch.file", "solver.precision")  # fmt: skip
"""Keys whose values mostly follow from others. They separate runs only if no other key does."""
NO_MATTER = ("output", "title")
"""Sections without effect on measured numbers."""


@dataclass(frozen=True)
class Number:
    """A number of a tack test: label of the axis, SI unit, and functions for the number and its uncertainty, which
    return None if there is none, or it is unknown."""

    name: str
    unit: str
    of: Callable[[Measures], float | None]
    uncertainty: Callable[[Measures], float | None] = lambda found: None


def _area(moment: str) -> Callable[[Measures], float | None]:
    return lambda found: getattr(found.areas.get("contact"), moment, None)


NUMBERS: dict[str, Number] = {
    "pull-off": Number(
        "pull-off force", "N", lambda found: found.pull_off.tension if found.pull_off else None,
        lambda found: found.pull_off.uncertainty if found.pull_off else None,
    ),
    "snap-in": Number(
        "snap-in force", "N", lambda found: found.snap_in.tension, lambda found: found.snap_in.uncertainty
    ),
    "separation": Number(
        "work of separation", "J", lambda found: found.work_of_separation,
        lambda found: found.work_of_separation_uncertainty,
    ),
    "loop": Number(
        "work of the loop", "J", lambda found: found.hysteresis, lambda found: found.hysteresis_uncertainty
    ),
    "preload": Number("force at the preload", "N", lambda found: found.preload),
    "largest-force": Number("largest force", "N", lambda found: found.largest_force),
    "contact-area": Number("contact area at the preload", "m^2", _area("at_preload")),
    "pull-off-area": Number("contact area at pull-off", "m^2", _area("at_pull_off")),
    "time-to-preload": Number("time to the preload", "s", lambda found: found.time_to_preload),
}  # fmt: skip
"""Numbers by their names for `pgfmd plot --y` (docs: reference, "Numbers")."""


@picture
def plot_numbers(*runs: Run, x: str = "", y: str = "pull-off", log: str = "") -> Figure:
    """A measured number of runs against a key of their scenes, with its uncertainty as an error bar.

    Args:
        runs: results, or folders.
        x: a key, such as "drive.speed", or "speed" if only one section has it; or another number of NUMBERS. Empty for
            the key in which the runs differ.
        y: of NUMBERS.
        log: axes with a logarithmic scale: "x", "y" or "xy".

    Raises:
        ResultError: if a run can't be read, x is ambiguous, or no run has both numbers.
        ValueError: if there is no y of this name.
    """
    if y not in NUMBERS:
        raise ValueError(f"{y!r}: expected one of {', '.join(NUMBERS)}")
    with opened_together(runs) as (results, loops):
        scenes = [flat(run) for run in results]
        x = key_of(x, scenes)
        measures = [measure(loop) for loop in loops]
        across: list[Any] = [_place(x, scene, found) for scene, found in zip(scenes, measures, strict=True)]
        if any(isinstance(place, str) for place in across):
            across = [None if place is None else str(scene[x]) for place, scene in zip(across, scenes, strict=True)]
        kept = [k for k, found in enumerate(measures) if NUMBERS[y].of(found) is not None and across[k] is not None]
        if not kept:
            raise ResultError(f"no run has both {x} and {NUMBERS[y].name}")
        figure = new_figure(5.2, 4.0)
        axis = figure.subplots()
        along = handy([_number(y, measures[k]) for k in kept], NUMBERS[y].unit)
        texts = sorted({place for place in across if isinstance(place, str)})
        at: dict[int, float] = {
            k: texts.index(place) if isinstance(place, str) else place
            for k, place in enumerate(across) if place is not None
        }  # fmt: skip
        wide = (1.0, "") if texts else handy([at[k] for k in kept], unit_of(x, scenes))
        for number, (label, members) in enumerate(groups(scenes, x, across, kept)):
            points = sorted((at[k] / wide[0], *_value(y, measures[k], along[0])) for k in members)
            places, values, spreads = zip(*points, strict=True)
            look: dict[str, Any] = {"color": PALETTE[number % len(PALETTE)], "linestyle": LINES[number % len(LINES)]}
            axis.errorbar(
                places, values, yerr=spreads, marker=MARKERS[number % len(MARKERS)], markersize=4, capsize=2.5,
                elinewidth=0.8, label=literal(label), **look,
            )  # fmt: skip
            if label:
                axis.legend(loc="best")
        if texts:
            axis.set_xticks(range(len(texts)), [literal(text) for text in texts])
        axis.set(
            xlabel=labelled(NUMBERS[x].name if x in NUMBERS else x, wide[1]), ylabel=labelled(NUMBERS[y].name, along[1])
        )
        _scale(axis, log if not texts else log.replace("x", ""))
        if "x" in log and not texts and place_ticks(axis, [at[k] / wide[0] for k in kept]):
            axis.xaxis.set_major_formatter("{x:.4g}")
        at_foot(figure, [results[k] for k in kept])
    return figure


def _scale(axis: Any, log: str) -> None:
    for letter in log:
        axis.set(**{f"{letter}scale": "log"})


def _number(y: str, found: Measures) -> float:
    """A number of a run; runs without it have been left out before."""
    value = NUMBERS[y].of(found)
    assert value is not None, "runs without it are left out"
    return value


def _value(y: str, found: Measures, factor: float) -> tuple[float, float]:
    """A number and its uncertainty, NaN if unknown, in the unit of the axis."""
    spread = NUMBERS[y].uncertainty(found)
    return _number(y, found) / factor, np.nan if spread is None else spread / factor


def flat(results: Results) -> dict[str, Any]:
    """The scene of a run with all keys on one level: "drive.speed" -> "1e-06 m/s"."""
    found: dict[str, Any] = {}

    def add(prefix: str, table: dict[str, Any]) -> None:
        for name, value in table.items():
            if isinstance(value, dict):
                add(f"{prefix}{name}.", value)
            else:
                found[f"{prefix}{name}"] = value

    add("", results.scene)
    return found


def key_of(x: str, scenes: Sequence[dict[str, Any]]) -> str:
    """The key of the scenes, or the number, for the name that a user gave, or for none. ResultError if it is
    ambiguous."""
    keys = dict.fromkeys(key for scene in scenes for key in scene)
    if x in keys:
        return x
    if x:
        near = [key for key in keys if key.rpartition(".")[2] == x]
        if len(near) == 1:
            return near[0]
        if x in NUMBERS:
            return x
        known = (
            f"more than one key: {', '.join(near)}"
            if near
            else f"no key of these scenes, nor one of {', '.join(NUMBERS)}"
        )
        raise ResultError(f"--x {x}: {known}; name a key with its section, such as drive.speed")
    differing = [key for key in differences(scenes) if key not in FOLLOW]
    if len(differing) != 1:
        what = f"they differ in {', '.join(differing)}" if differing else "they differ in no key"
        raise ResultError(f"which key the runs are to be drawn against is not clear, {what}; say it with --x")
    return differing[0]


def differences(scenes: Sequence[dict[str, Any]]) -> list[str]:
    """The keys in which scenes differ, without those of the output."""
    keys = dict.fromkeys(key for scene in scenes for key in scene)
    mattering = [key for key in keys if key.partition(".")[0] not in NO_MATTER]
    return [key for key in mattering if len({str(scene.get(key)) for scene in scenes}) > 1]


def groups(
    scenes: Sequence[dict[str, Any]], x: str, across: Sequence[Any], kept: Sequence[int]
) -> Iterator[tuple[str, list[int]]]:
    """Label and numbers of the runs of one line: those that only differ in x and in keys that follow from it."""
    others = [key for key in differences([scenes[k] for k in kept]) if key != x]
    parting = [key for key in others if key not in FOLLOW]
    found = _parted(scenes, parting, kept)
    if any(len({across[k] for k in members}) < len(members) for members in found.values()):
        parting = others
        found = _parted(scenes, parting, kept)
    for values, members in found.items():
        yield (
            ", ".join(f"{key.rpartition('.')[2]} {_plain(value)}" for key, value in zip(parting, values, strict=True)),
            members,
        )


def _parted(
    scenes: Sequence[dict[str, Any]], keys: Sequence[str], kept: Sequence[int]
) -> dict[tuple[str, ...], list[int]]:
    found: dict[tuple[str, ...], list[int]] = {}
    for k in kept:
        found.setdefault(tuple(str(scenes[k].get(key)) for key in keys), []).append(k)
    return found


def _plain(text: str) -> str:
    """A value of a resolved scene for a legend: three digits, and a unit with a prefix."""
    number, unit = split(text)
    if number is None:
        return text
    factor, name = handy([number], unit)
    return f"{number / factor:.4g} {name}".strip()


def split(value: Any) -> tuple[float | None, str]:
    """Number and SI unit of a value of a resolved scene; None if it is not a number."""
    number, _, unit = str(value).partition(" ")
    try:
        return (None, "") if isinstance(value, bool) else (float(number), unit)
    except ValueError:
        return None, ""


def _place(x: str, scene: dict[str, Any], found: Measures) -> float | str | None:
    """The value of a run on an axis: a number in SI units, or a text; None if it has none."""
    if x not in scene:
        return NUMBERS[x].of(found) if x in NUMBERS else None
    number, _ = split(scene[x])
    return str(scene[x]) if number is None else number


def unit_of(x: str, scenes: Sequence[dict[str, Any]]) -> str:
    """The SI unit of an axis."""
    if not any(x in scene for scene in scenes):
        return NUMBERS[x].unit
    return next(split(scene[x])[1] for scene in scenes if x in scene)
