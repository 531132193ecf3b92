"""Force against displacement: the triangular and the hexagonal pattern, and the rheological models."""

from __future__ import annotations

from typing import Any

import numpy as np

from pgfmd.analysis.bulges import bulges

from .drawing import (
    COLOURS,
    GREY,
    Claim,
    Drawing,
    closed_at,
    count_of,
    covered,
    draw_loop,
    force_axes,
    joins,
    panels,
    pull_off,
    settings_of,
    zoom,
)
from .evolution import LAST, rim_last
from .pool import Run, Runs

TRI_PULL_OFF = {40.0: ("2.5 ± 0.5", 2.0, 3.0), 80.0: ("up to 14 ± 2", 12.0, 16.0)}
MODELS = {"model-1": "model 1", "model-2": "model 2", "model-3": "model 3", "quasi-static": "quasi-static"}


LOAD_LINES = ("-", (0, (4, 2)), (0, (1, 1.5)))
SPEED_COLOURS = dict(zip((1.0, 25.0, 5.0, 0.5), COLOURS, strict=False))
"""A colour for each speed [um/s], the same in all figures."""


def legend_above(figure: Any, axis: Any) -> None:
    """One legend above all panels: within them there is no free place."""
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=max(len(labels), 1))


def minima(run: Run) -> int:
    """Number of bulges of the retraction, the pull-off among them."""
    return len(bulges(run.loop))


def area_claim(run: Run, settings: str) -> Claim:
    """The contact area at the preload beside the full one."""
    words = ("contact area at the preload, of the punch", settings, covered(run), "%", "full", 95, 100)
    return Claim(*words, count=count_of(run), before=covered(run, "overlap"))


def tri(runs: Runs) -> Drawing:
    """Retraction from 40, 60 (and 50) and 80 mN at four speeds, triangular pattern, as in FIG FDtri."""
    figure, axes = panels(3, height=3.3)
    for axis, loads in zip(axes[0], ((40.0,), (60.0, 50.0), (80.0,)), strict=True):
        for run in runs.of("tri"):
            if run.preload in loads:
                dotted = {"ls": ":"} if run.preload == 50.0 else {"label": f"{run.speed:g} µm/s"}
                draw_loop(axis, run, SPEED_COLOURS.get(run.speed, GREY), approach=run.preload == loads[0], **dotted)
        force_axes(axis, f"{loads[0]:g} mN" + (", dotted 50 mN" if len(loads) > 1 else ""))
        # The way back near zero force is what the figure is about.
        zoom(axis, [run for run in runs.of("tri") if run.preload in loads])
    legend_above(figure, axes[0, 0])
    claims = []
    for load in (40.0, 50.0, 60.0, 80.0):
        told, low, high = TRI_PULL_OFF.get(load, ("", np.nan, np.nan))
        found = {run.speed: pull_off(run) for run in runs.of("tri", preload=load)}
        if load == 80.0 and found:
            largest = max(found.values())
            claims.append(Claim("pull-off force, largest of all speeds", "80 mN", largest, "mN", told, low, high))
            told, low, high = "", np.nan, np.nan
        for speed, force in found.items():
            claims.append(Claim("pull-off force", f"{load:g} mN, {speed:g} µm/s", force, "mN", told, low, high))
    run = runs.one("tri", preload=80.0, speed=1.0)
    if run:
        told = ("a little before 60", 55, 60)
        for kind, what, words in (("valley", "force at full contact (all valleys)", told),
                                  ("saddle", "force at contact in all saddles", ())):  # fmt: skip
            closed = closed_at(run.results, kind)
            claims.append(Claim(what, "80 mN, 1 µm/s", closed, "mN", *words, count=count_of(run)))
    claims += [
        area_claim(run, f"{load:g} mN, 1 µm/s")
        for load in (60.0, 80.0)
        if (run := runs.one("tri", preload=load, speed=1.0))
    ]
    for load, speed, told, count in ((40.0, 0.5, "2", 2), (80.0, 25.0, "1", 1)):
        run = runs.one("tri", preload=load, speed=speed)
        if run:
            settings = f"{load:g} mN, {speed:g} µm/s"
            claims.append(Claim("bulges of the retraction", settings, minima(run), "", told, count, count))
    caption = f"Approach in grey, retraction in colour; {_common(runs)}. Displacements as in the cell, uncorrected."
    return Drawing(figure, caption, claims)


def _common(runs: Runs) -> str:
    return settings_of(next(run for run in runs if not run.quasistatic))


def rheology(runs: Runs) -> Drawing:
    """Models 1, 2, 3 and quasi-static from 40, 60 and 80 mN at 1 um/s, as in FIG FDrheo b to d."""
    figure, axes = panels(3, height=3.3)
    claims = []
    for axis, load in zip(axes[0], (40.0, 60.0, 80.0), strict=True):
        for (name, label), colour in zip(MODELS.items(), COLOURS, strict=False):
            run = runs.one("rheology", name, preload=load)
            if run:
                draw_loop(axis, run, "black" if run.quasistatic else colour, label, approach=name == "model-1")
        force_axes(axis, f"{load:g} mN")
        zoom(axis, runs.of("rheology", preload=load))
    legend_above(figure, axes[0, 0])
    for name, label in MODELS.items():
        told = ("0.7", 0.65, 0.75) if name == "quasi-static" else ("", np.nan, np.nan)
        found = {run.preload: run for run in runs.of("rheology", name)}
        for load, run in found.items():
            claims.append(Claim("pull-off force", f"{label}, {load:g} mN", pull_off(run), "mN", *told))
        if {40.0, 80.0} <= set(found):
            ratio = pull_off(found[80.0]) / pull_off(found[40.0])
            admitted = {"quasi-static": ("1", 0.95, 1.05), "model-3": ("largest of all",)}.get(name, ())
            claims.append(Claim("pull-off at 80 mN over that at 40 mN", label, ratio, "", *admitted))
    run = runs.one("rheology", "model-3", preload=60.0)
    if run:
        loop = run.loop
        at = 1e6 * float(loop.indentation[int(np.argmin(loop.force))])
        told = "slightly positive"
        claims.append(Claim("indentation at the largest tension", "model 3, 60 mN", at, "µm", told, 0.0, 5.0))
    caption = f"1 µm/s; model 1: {_common(runs)}; models 2 and 3 with τ_min a tenth of that. Quasi-static in black."
    return Drawing(figure, caption, claims)


def hexagonal(runs: Runs) -> Drawing:
    """Tack tests to 1, 5 and 10 mN at 1 and 25 um/s, hexagonal pattern, as in FIG FDhex."""
    figure, axes = panels(3, height=3.3)
    still = runs.one("hex", quasistatic=True)
    claims = []
    for axis, load in zip(axes[0], (1.0, 5.0, 10.0), strict=True):
        for run in runs.of("hex", preload=load, quasistatic=False):
            colour = SPEED_COLOURS.get(run.speed, GREY)
            draw_loop(axis, run, colour, f"{run.speed:g} µm/s", approach=False)
            rows, x, y = run.loop.branches["approach"], 1e6 * run.loop.indentation, 1e3 * run.loop.force
            axis.plot(x[rows], y[rows], color=colour, ls=(0, (3, 2)), lw=0.8)
            settings = f"{load:g} mN, {run.speed:g} µm/s"
            told = ("about 7", 6.5, 7.5) if load > 1 and run.speed == 25 else ("", np.nan, np.nan)
            claims.append(Claim("pull-off force", settings, pull_off(run), "mN", *told))
            claims.append(Claim("bulges of the retraction", settings, minima(run), "", "1", 1, 1))
        if still and load == still.preload:
            draw_loop(axis, still, "black", "quasi-static", approach=False, lw=0.9)
        force_axes(axis, f"{load:g} mN")
    legend_above(figure, axes[0, 0])
    if still:
        claims.append(Claim("pull-off force", "quasi-static", pull_off(still), "mN", "1.2", 1.15, 1.25))
        jumped, what = _first_jump(still), "tension right after the jump into contact"
        claims.append(Claim(what, "quasi-static", jumped, "mN", "0.8", 0.75, 0.85, count=count_of(still)))
    run = runs.one("hex", preload=10.0, speed=1.0)
    if run:
        words = ("force at contact in all saddles", "10 mN, 1 µm/s", closed_at(run.results, "saddle"), "mN")
        claims.append(Claim(*words, "about 4", 3.5, 4.5, count=count_of(run)))
    caption = f"Approach dashed, retraction solid; {_common(runs)}. Displacements as in the cell, uncorrected."
    return Drawing(figure, caption, claims)


def _first_jump(run: Run) -> float:
    """Tension [mN] right after the first jump into contact: at the first row at which a summit has joined."""
    found, loop = joins(run.results, "summit"), run.loop
    first = float(found["displacement [m]"].max())
    row = int(np.flatnonzero((loop.displacement <= first) & (loop.phase == "approach"))[0])
    return -1e3 * float(loop.force[row])


CURVED = {"curved-tri": "triangular", "curved-hex": "hexagonal"}


def curved(runs: Runs) -> Drawing:
    """Tack tests of a punch with the curvature that gives the paper's quasi-static forces, both patterns."""
    figure, axes = panels(2, height=3.4)
    claims = []
    for axis, (study, title) in zip(axes[0], CURVED.items(), strict=True):
        loads = sorted({run.preload for run in runs.of(study)})
        for run in runs.of(study):
            colour, label = SPEED_COLOURS.get(run.speed, GREY), f"{run.preload:g} mN, {run.speed:g} µm/s"
            draw_loop(axis, run, colour, label, approach=False, ls=LOAD_LINES[loads.index(run.preload)])
            told = TRI_PULL_OFF.get(run.preload, ()) if study == "curved-tri" else ("about 7", 6.5, 7.5)
            told = () if run.preload == 80.0 or (study == "curved-hex" and run.speed != 25.0) else told
            claims.append(Claim("pull-off force", f"{title}, {label}", pull_off(run), "mN", *told))
        force_axes(axis, title)
        zoom(axis, runs.of(study))
        axis.legend(fontsize=6.5)
    notes = "; ".join(settings_of(run) for study in CURVED for run in list(runs.of(study))[:1])
    caption = f"Retraction, macroscopic curvature of 40 mm. {notes}."
    return Drawing(figure, caption, [*claims, *_curved_tri(runs), *_curved_hex(runs)])


def _curved_tri(runs: Runs) -> list[Claim]:
    claims = []
    if forces := [pull_off(run) for run in runs.of("curved-tri", preload=80.0)]:
        words = ("pull-off force, largest of all speeds", "triangular, 80 mN")
        claims.append(Claim(*words, max(forces), "mN", *TRI_PULL_OFF[80.0]))
    claims += [
        area_claim(run, f"triangular, {load:g} mN, 1 µm/s")
        for load in (60.0, 80.0)
        if (run := runs.one("curved-tri", preload=load, speed=1.0))
    ]
    if run := runs.one("curved-tri", preload=40.0, speed=1.0):
        saddles = joins(run.results, "saddle")
        far = np.hypot(saddles["x [m]"], saddles["y [m]"]) / run.scene.punch.radius
        words = ("mean distance of closed saddles from the axis", "triangular, 40 mN, 1 µm/s")
        mean = float(far.mean()) if far.size else np.nan
        claims.append(Claim(*words, mean, "a", "close to the rim", 0.75, 1.0, count=count_of(run)))
    return claims


def _curved_hex(runs: Runs) -> list[Claim]:
    run, settings = runs.one("curved-hex", preload=10.0, speed=1.0), "hexagonal, 10 mN, 1 µm/s"
    if not run:
        return []
    closed = closed_at(run.results, "saddle")
    return [
        Claim("force at contact in all saddles", settings, closed, "mN", "about 4", 3.5, 4.5, count=count_of(run)),
        Claim(LAST, settings, rim_last(run), "", "the rim comes last", 1.05, 2.0, count=count_of(run)),
    ]
