"""What the paper does not have: a broad spectrum, a free boundary, the loop split into its causes."""

from __future__ import annotations

import numpy as np

from pgfmd.analysis.compliance import corrected_simulation, fit_cell_compliance
from pgfmd.analysis.hysteresis import audit_of, twin_of

from .drawing import (
    COLOURS,
    GREY,
    OCHRE,
    RED,
    TURQUOISE,
    VIOLET,
    Claim,
    Drawing,
    draw_loop,
    force_axes,
    panels,
    pull_off,
    settings_of,
    zoom,
)
from .pool import Run, Runs

STEPS_PER_TAU = 20
"""Steps of the paper's explicit scheme in the shortest relaxation time."""


def broad(runs: Runs) -> Drawing:
    """Tack tests with a spectrum of eight decades, beside model 1."""
    loads = {"tri": (40.0, 60.0, 80.0), "hex": (5.0, 10.0)}
    if not any(run.name.startswith("broad") for run in runs):
        raise LookupError("no run with the broad spectrum is finished")
    figure, axes = panels(3, 2, height=5.6)
    axes[1, 2].set_axis_off()
    claims, wide = [], []
    for line, (pattern, preloads) in zip(axes, loads.items(), strict=True):
        for axis, load in zip(line, preloads, strict=False):
            for speed, colour in zip((1.0, 25.0), COLOURS, strict=False):
                here = {"study": f"dma-{pattern}", "preload": load, "speed": speed}
                single, run = (runs.one(name=word, **here) for word in ("single", "broad"))
                if single:
                    draw_loop(axis, single, colour, f"model 1, {speed:g} µm/s", approach=False, ls=":")
                if run:
                    wide.append((run, single))
                    draw_loop(axis, run, colour, f"broad, {speed:g} µm/s", approach=False)
                    settings = f"{pattern}, {load:g} mN, {speed:g} µm/s"
                    claims.append(Claim("pull-off force, broad spectrum", settings, pull_off(run), "mN"))
                    if single:
                        claims.append(Claim("over that of model 1", settings, pull_off(run) / pull_off(single)))
            force_axes(axis, f"{pattern}, {load:g} mN")
            zoom(axis, runs.of(f"dma-{pattern}", preload=load))
            if not axis.lines[1:]:
                # Nothing but the line at force zero: none of its runs is there.
                axis.set_axis_off()
    handles, labels = max((axis.get_legend_handles_labels() for axis in axes.flat), key=lambda found: len(found[1]))
    axes[1, 2].legend(handles, labels, loc="center")
    pairs = [(run, single) for run, single in wide if single]
    if pairs:
        cost, explicit = [], []
        for run, single in pairs:
            record = run.results.run
            cost.append(record["transform_pairs"] / single.results.run["transform_pairs"])
            steps = run.loop.time[-1] * STEPS_PER_TAU / run.scene.rheology.relaxation_time
            explicit.append(steps / record["steps"])
        claims.append(Claim("transform pairs of a run, over model 1", "mean of all", np.mean(cost), "", "unfeasible"))
        claims.append(Claim("steps of the paper's scheme over ours", "τ_min/20, mean of all", np.mean(explicit)))
    settings = settings_of(wide[0][0]) if wide else ""
    caption = f"N = 20, β = 0.5, κ_∞ = 1000 over eight decades; {settings}. Retraction only."
    return Drawing(figure, caption, claims)


def free(runs: Runs) -> Drawing:
    """The punch alone on an infinite plane against the periodic cell, with and without its correction."""
    if not any(run.name == "boundary-free" for run in runs):
        raise LookupError("no run with a free boundary is finished")
    figure, axes = panels(2, height=3.3)
    claims = []
    for axis, pattern in zip(axes[0], ("tri", "hex"), strict=True):
        periodic, alone = (runs.one(f"free-{pattern}", f"boundary-{word}") for word in ("periodic", "free"))
        if not (periodic and alone):
            axis.set_axis_off()
            continue
        fit = fit_cell_compliance(periodic.loop)
        corrected = corrected_simulation(periodic.loop, fit.stiffness)
        depth = {}
        for label, loop, colour, style in (
            ("periodic", periodic.loop, TURQUOISE, "-"), ("periodic + F/k_cc", corrected, OCHRE, (0, (4, 2))),
            ("free", alone.loop, RED, "-"),
        ):  # fmt: skip
            axis.plot(1e6 * loop.indentation, 1e3 * loop.force, color=colour, ls=style, lw=1.0, label=label)
            depth[label] = 1e6 * float(loop.indentation[loop.preload_row])
        force_axes(axis, f"{pattern}, {periodic.preload:g} mN")
        axis.legend()
        for label, value in depth.items():
            claims.append(Claim("indentation at the preload", f"{pattern}, {label}", value, "µm"))
        gap = depth["free"] - depth["periodic"]
        told = "quite well"
        claims.append(Claim("share of the difference to free that F/k_cc accounts for", pattern,
                            100 * (depth["periodic + F/k_cc"] - depth["periodic"]) / gap, "%", told))  # fmt: skip
        claims += [Claim("pull-off force", f"{pattern}, {word}", pull_off(run), "mN")
                   for word, run in (("periodic", periodic), ("free", alone))]  # fmt: skip
    return Drawing(figure, f"Loops at 1 µm/s; {settings_of(next(iter(runs)))}.", claims)


def split(runs: Runs) -> Drawing:
    """The work of viscous loops beside that of their quasi-static twins, and where the audits say it went."""
    pairs: list[tuple[str, Run, Run]] = []
    for run in runs:
        twin = runs.one(run.study, "quasistatic", preload=run.preload)
        if twin and not run.quasistatic:
            name = run.name.partition("-")[0] + " " + run.name.split("-")[1]
            pairs.append((f"{run.study.removeprefix('split-')}, {run.preload:g} mN, {name}", run, twin))
    if not pairs:
        raise LookupError("no viscous run has a finished quasi-static twin of the same preload")
    figure, axes = panels(1, width=7.0, height=0.32 * len(pairs) + 1.3)
    axis, claims = axes[0, 0], []
    for place, (name, run, twin) in enumerate(pairs):
        found, audit = twin_of(run.results, run.loop, twin.results), audit_of(run.results)
        labels = (None, None) if place else ("quasi-static twin", "the rest: viscous and coaction")
        start = 1e9 * found.twin_loop
        axis.barh(place, start, color=VIOLET, height=0.6, label=labels[0])
        axis.barh(place, 1e9 * found.rest, left=start, color=GREY, height=0.6, label=labels[1])
        claims.append(Claim("work of the loop", name, 1e9 * found.loop, "nJ"))
        share = 100 * (found.multistability_share or 0.0)
        claims.append(Claim("share of the quasi-static twin's loop", name, share, "%"))
        if audit:
            share = 100 * (audit.share(audit.viscous) or 0.0)
            claims.append(Claim("share that the audit assigns to viscosity", name, share, "%"))
    axis.set_yticks(range(len(pairs)), [name for name, _, _ in pairs], fontsize=7.5)
    axis.invert_yaxis()
    axis.set(xlabel="work of the loop (nJ)")
    axis.legend()
    settings = settings_of(pairs[0][1])
    caption = f"Loops at 1 µm/s, and quasi-static loops of the same punch; model 1: {settings}."
    return Drawing(figure, caption, claims)
