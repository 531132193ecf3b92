"""What the results depend on: curvature of the punch, range of adhesion against relaxation time."""

from __future__ import annotations

import numpy as np

from pgfmd.studies.convergence import fit_power_law

from .drawing import (
    COLOURS,
    NAN,
    RED,
    TURQUOISE,
    Claim,
    Drawing,
    closed_at,
    count_of,
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

LINES = ("-", (0, (6, 2)), (0, (3, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)))
CURVATURES = ("flat", "200mm", "100mm", "50mm", "20mm", "100mm-layers")


def curvature(runs: Runs) -> Drawing:
    """Loops of both patterns for several macroscopic curvatures, and with printing layers."""
    if all(run.name == "flat" for run in runs):
        raise LookupError("no run with a curvature is finished")
    figure, axes = panels(2, height=3.4)
    claims = []
    patterns = {"curvature-tri": "triangular", "curvature-hex": "hexagonal"}
    for axis, (study, title) in zip(axes[0], patterns.items(), strict=True):
        found = {name: run for name in CURVATURES for run in runs.of(study) if run.name == name}
        for (name, run), colour in zip(found.items(), COLOURS, strict=False):
            label = "no curvature" if name == "flat" else name.replace("mm", " mm").replace("-layers", ", layers")
            draw_loop(axis, run, colour, label, approach=False, ls=":" if "layers" in name else "-")
            claims.append(Claim("pull-off force", f"{title}, {label}", pull_off(run), "mN"))
            claims += _contact_claims(run, f"{title}, {label}", study == "curvature-hex")
        load = next(iter(found.values())).preload if found else 0
        force_axes(axis, f"{title}, {load:g} mN")
        zoom(axis, found.values())
        if found:
            axis.legend(fontsize=7)
    rims = ", ".join(f"{1e6 * 375e-6**2 / (2e-3 * r):.2g} µm ({r} mm)" for r in (200, 100, 50, 20))
    notes = "; ".join(f"{title}: {settings_of(run)}" for study, title in patterns.items() if (run := runs.one(study)))
    caption = f"Retraction at 1 µm/s for radii of the macroscopic curvature; it lifts the rim by {rims}. {notes}."
    return Drawing(figure, caption, claims)


def _contact_claims(run: Run, settings: str, hexagonal: bool) -> list[Claim]:
    count = count_of(run)
    claims = [Claim("saddles closed during the approach", settings, _share(run, "saddle"), "%", count=count)]
    if hexagonal:
        closed = closed_at(run.results, "saddle")
        words = ("force at contact in all saddles", settings, closed, "mN", "about 4", 3.5, 4.5)
        claims.append(Claim(*words, count=count))
        claims.append(Claim(LAST, settings, rim_last(run), "", "the rim comes last", 1.05, 2.0, count=count))
    return claims


def _share(run: Run, kind: str) -> float:
    found = joins(run.results, kind)
    return 100 * len(found["site"]) / found["of"][0] if found["site"].size else 0.0


LABELS = {"default": "ρ, τ", "alternative": "√2 ρ, 2.5 τ", "same-time": "√2 ρ, τ"}


def ranges(runs: Runs) -> Drawing:
    """Range of adhesion sqrt(2) times as large against a relaxation time 2.5 times as long."""
    found = {name: run for name in LABELS if (run := runs.one("range", name))}
    if len(found) < 2:
        raise LookupError("only one of its runs is finished")
    figure, axes = panels(1, height=3.4, width=5.2)
    axis, claims = axes[0, 0], []
    for (name, run), colour in zip(found.items(), COLOURS, strict=False):
        draw_loop(axis, run, colour, LABELS[name], approach=name == "default")
    force_axes(axis)
    zoom(axis, found.values())
    axis.legend()
    default = found.get("default")
    for name in ("alternative", "same-time"):
        if default and name in found:
            told = ("close", 0.9, 1.1) if name == "alternative" else ("", NAN, NAN)
            other, label = found[name], LABELS[name]
            ratio = pull_off(other) / pull_off(default)
            claims.append(Claim("pull-off force over that of ρ, τ", label, ratio, "", *told))
            away = 100 * _apart(other, default)
            claims.append(Claim("rms difference of the retraction, over the preload", label, away, "%"))
            ratio = other.results.run["work_J"] / default.results.run["work_J"]
            claims.append(Claim("work of the loop over that of ρ, τ", label, ratio, "", *told))
    notes = "; ".join(f"{LABELS[name]}: {settings_of(run)}" for name, run in found.items())
    return Drawing(figure, f"Retraction from 40 mN at 1 µm/s. {notes}.", claims)


def _apart(run: Run, other: Run) -> float:
    """Root mean square of the difference of the forces of two ways back, over the preload."""
    low = max(run.loop.displacement.min(), other.loop.displacement.min())
    grid = np.linspace(low, 1e-6, 2000)
    curves = []
    for each in (run, other):
        rows = each.loop.branches["retraction"]
        curves.append(np.interp(grid, np.maximum.accumulate(each.loop.displacement[rows]), each.loop.force[rows]))
    return float(np.sqrt(np.mean((curves[0] - curves[1]) ** 2)) / run.scene.drive.preload)


def halved(runs: Runs) -> Drawing:
    """The range of adhesion halved, once and twice; n grows fourfold each time."""
    figure, axes = panels(2, height=3.2)
    left, right = axes[0]
    ordered = sorted(runs.of("halved"), key=lambda run: run.scene.grid.n)
    if len({run.scene.grid.n for run in ordered}) < 2:
        raise LookupError("only one range of adhesion is finished")
    claims = []
    rows = {"rule": ("τ by the rule", TURQUOISE), "same": ("same τ", RED)}
    for word, (label, colour) in rows.items():
        if not any(word in run.name for run in ordered):
            continue
        # A case without a word of its own belongs to both.
        chosen = [run for run in ordered if word in run.name or "-" not in run.name]
        for run, style in zip(chosen, (":", (0, (4, 2)), "-"), strict=False):
            draw_loop(left, run, colour, f"n = {run.scene.grid.n}, {label}", approach=False, ls=style)
            settings = f"{label}, n = {run.scene.grid.n}"
            claims.append(Claim("pull-off force", settings, pull_off(run), "mN"))
            claims.append(Claim("work of the loop", settings, 1e9 * run.results.run["work_J"], "nJ"))
        sizes = [1e6 * run.scene.adhesion.range for run in chosen]
        forces = [pull_off(run) for run in chosen]
        right.plot(sizes, forces, "o-", color=colour, mfc="white", label=label)
        if len(chosen) >= 3:
            fit = fit_power_law(sizes, forces)
            # At the ends of what is tried there is no power law.
            if 0.06 < fit.power < 5.5:
                claims.append(Claim("power of ρ in the pull-off force, fitted", label, fit.power))
    force_axes(left)
    zoom(left, ordered)
    left.legend(fontsize=6.5)
    right.set(xlabel="range of adhesion ρ (µm)", ylabel="pull-off force (mN)", xlim=(0, None), ylim=(0, None))
    right.legend()
    caption = "Hexagonal, retraction from 10 mN at 25 µm/s. " + "; ".join(settings_of(run) for run in ordered) + "."
    return Drawing(figure, caption, claims)


STILL = {"still-tri": ("triangular", TURQUOISE, 0.7), "still-hex": ("hexagonal", RED, 1.2)}
"""Title, colour and the paper's quasi-static pull-off force [mN] of the studies of curved punches."""


def still(runs: Runs) -> Drawing:
    """Quasi-static loops of curved punches, and which curvature makes the paper's pull-off forces."""
    figure, axes = panels(2, height=3.3)
    left, right = axes[0]
    claims, found = [], {}
    for study, (title, colour, told) in STILL.items():
        own = {run.scene.punch.curvature_radius: run for run in runs.of(study)}
        for (radius, run), style in zip(sorted(own.items(), reverse=True), LINES, strict=False):
            label = _told(radius)
            draw_loop(left, run, colour, label if study == "still-hex" else None, approach=False, ls=style)
            words, settings = (f"{told:g}", told - 0.05, told + 0.05), f"{title}, {label}"
            claims.append(Claim("pull-off force", settings, pull_off(run), "mN", *words))
            claims.append(Claim("work of the loop", settings, 1e9 * run.results.run["work_J"], "nJ"))
            if study == "still-hex":
                pulled = -1e3 * float(run.loop.force[: run.loop.preload_row].min())
                claims.append(Claim("largest tension during the approach", settings, pulled, "mN", "0.8", 0.75, 0.85))
        found[title] = {radius: pull_off(run) for radius, run in sorted(own.items())}
        bent = [1e-3 / radius for radius in found[title]]
        right.plot(bent, list(found[title].values()), "o-", color=colour, mfc="white", label=title)
        right.axhline(told, color=colour, ls=(0, (4, 2)), lw=0.8)
        if len(bent) > 1:
            settings = f"{title}, interpolated"
            radius = _curvature_for(told, bent, list(found[title].values()))
            claims.append(Claim("radius that makes the paper's pull-off force", settings, radius, "mm"))
    for radius in sorted(found["triangular"].keys() & found["hexagonal"].keys(), reverse=True):
        ratio = found["triangular"][radius] / found["hexagonal"][radius]
        claims.append(Claim("pull-off force, triangular over hexagonal", _told(radius), ratio, "", "0.6", 0.55, 0.65))
    force_axes(left)
    zoom(left, [run for study in STILL for run in runs.of(study)])
    left.legend(fontsize=7)
    right.set(xlabel="curvature of the punch (1/mm)", ylabel="pull-off force (mN)", ylim=(0, None))
    right.legend()
    notes = settings_of(next(iter(runs)))
    caption = (
        f"Quasi-static retractions, triangular in turquoise, hexagonal in red; dashed: the paper's forces. {notes}."
    )
    return Drawing(figure, caption, claims)


def _told(radius: float) -> str:
    return "no curvature" if np.isinf(radius) else f"{1e3 * radius:g} mm"


def _curvature_for(force: float, curvatures: list[float], forces: list[float]) -> float:
    """Radius [mm] at which the pull-off force, falling with the curvature [1/mm], is this; NaN beyond what was run."""
    order = np.argsort(forces)
    lowest, highest = forces[order[0]], forces[order[-1]]
    if not lowest <= force <= highest:
        return NAN
    bent = np.interp(force, np.asarray(forces)[order], np.asarray(curvatures)[order])
    return float(1.0 / bent) if bent > 0.0 else np.inf
