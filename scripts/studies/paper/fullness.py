"""Whether and when the triangular pattern comes into full contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from .drawing import (
    GREY,
    NAN,
    RED,
    TURQUOISE,
    Claim,
    Drawing,
    count_of,
    covered,
    draw_gaps,
    new_figure,
    settings_of,
    shades_of,
)
from .pool import Run, Runs

SHOWN_FORCE = 60.0
KINDS = {"contact": "-", "overlap": ":", "near": (0, (4, 2))}
"""Areas that are drawn, and their lines."""
SHAPES = {"flat": ("no curvature", TURQUOISE), "curved": ("40 mm", RED)}
DRIVES = {"viscous": "1 µm/s", "quasistatic": "quasi-static"}


def full(runs: Runs) -> Drawing:
    """Areas of contact, of overlap and closer than 500 nm on the way to 80 mN, triangular pattern."""
    made = {
        drive: {shape: run for shape in SHAPES if (run := runs.one("full-tri", f"{shape}-{drive}"))} for drive in DRIVES
    }
    shown = [drive for drive in DRIVES if made[drive]]
    if not shown:
        raise LookupError("none of its runs is finished")
    figure = new_figure(3.7 * len(shown), 5.6)
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
    axes = top.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    places = iter(bottom.subplots(1, 2 * len(shown)))
    claims, notes = [], []
    for axis, drive in zip(axes, shown, strict=True):
        title = DRIVES[drive]
        for shape, (label, colour) in SHAPES.items():
            place = next(places)
            place.set_axis_off()
            if run := made[drive].get(shape):
                _draw_areas(axis, run, colour, label)
                _draw_map(place, run, f"{label}, {title}")
                claims += _claims(run, f"{title}, {label}")
                notes.append(f"{title}, {label}: {settings_of(run).removesuffix(', quasi-static')}")
        axis.axvline(SHOWN_FORCE, color=GREY, lw=0.6)
        axis.set(xlabel="force on the way in (mN)", xlim=(0, None), ylim=(0, 103))
        axis.set_title(f"{title}", loc="left")
        if axis.lines[1:]:
            axis.legend(loc="lower right", fontsize=7)
    axes[0].set_ylabel("area (% of the punch)")
    caption = (
        f"Solid: contact; dotted: gap below 0; dashed: gap below 500 nm. Maps: the snapshots nearest to {SHOWN_FORCE:g} "
        f"mN in the approach. {shades_of(runs)} {'; '.join(notes)}."
    )
    return Drawing(figure, caption, claims)


def _way_in(run: Run) -> slice:
    return slice(0, run.loop.preload_row + 1)


def _draw_areas(axis: Any, run: Run, colour: str, label: str) -> None:
    rows = _way_in(run)
    force = 1e3 * run.loop.force[rows]
    for kind, style in KINDS.items():
        told = label if kind == "contact" else None
        axis.plot(force, covered(run, kind, rows), color=colour, ls=style, lw=1.1, label=told)


def _draw_map(axis: Any, run: Run, title: str) -> None:
    fields = run.results.fields
    force, time = 1e3 * np.asarray(fields["force"][:]), np.asarray(fields["time"][:])
    way_in = np.flatnonzero(time <= run.loop.time[run.loop.preload_row] * (1 + 1e-12))
    frame = int(way_in[np.argmin(np.abs(force[way_in] - SHOWN_FORCE))])
    draw_gaps(axis, run, frame)
    axis.set_title(f"{title}\n{force[frame]:.3g} mN", fontsize=7)


def _claims(run: Run, settings: str) -> list[Claim]:
    count = count_of(run)
    # The paper's full contact is that of its tack tests.
    told, all_of_it, none = ("", NAN, NAN), ("", NAN, NAN), ("", NAN, NAN)
    if not run.quasistatic:
        told, all_of_it, none = ("a little before 60", 55, 60), ("full", 95, 100), ("0", 0, 0.01)
    contact, overlap = _force_at(run, "contact"), _force_at(run, "overlap")
    at = _row_at(run, SHOWN_FORCE)
    return [
        Claim("force at full contact", settings, contact, "mN", *told, count, overlap),
        Claim("force at which no point is open", settings, _force_at(run, "near"), "mN", *told),
        Claim(f"contact area at {SHOWN_FORCE:g} mN, of the punch", settings, covered(run, "contact", at), "%",
              *all_of_it, count, covered(run, "overlap", at)),
        Claim(f"area further than 500 nm at {SHOWN_FORCE:g} mN, of the punch", settings,
              100.0 - covered(run, "near", at), "%", *none),
    ]  # fmt: skip


def _force_at(run: Run, kind: str) -> float:
    """Force [mN] at which an area first is all of the punch on the way in, NaN if it never is."""
    rows = _way_in(run)
    there = np.flatnonzero(covered(run, kind, rows) == 100.0)
    return 1e3 * float(run.loop.force[rows][there[0]]) if there.size else NAN


def _row_at(run: Run, force: float) -> int:
    """The row of the way in whose force [mN] is nearest to this."""
    return int(np.argmin(np.abs(1e3 * run.loop.force[_way_in(run)] - force)))
