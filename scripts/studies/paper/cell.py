"""The surface of the whole cell, and the compliance that periodic images add."""

from __future__ import annotations

import numpy as np

from pgfmd.analysis.compliance import fit_cell_compliance
from pgfmd.parts import topography_of

from .drawing import GREY, OCHRE, RED, TURQUOISE, Claim, Drawing, panels, settings_of
from .pool import Run, Runs


def frame_at(run: Run, fraction: float) -> int:
    """The snapshot nearest to a fraction of t_pl."""
    return int(np.argmin(np.abs(fractions(run) - fraction)))


def fractions(run: Run) -> np.ndarray:
    """Times of the snapshots in units of t_pl, from the first contact on."""
    results = run.results
    events = results.events
    rows = np.asarray(events["event"]).astype(str) == "preload"
    preload, span = float(np.asarray(events["time [s]"])[rows][0]), results.run["time_to_preload_s"]
    return 1.0 + (np.asarray(results.fields["time"][:]) - preload) / span


def sketch(runs: Runs) -> Drawing:
    """Punch and elastomer along a cut through the axis, during compression, as in FIG model."""
    run = runs.one("cell")
    results, snapshot = run.results, frame_at(run, 0.7)
    fields = results.fields
    surface = results.frame("surface_displacement", snapshot)
    y = np.asarray(fields["y_cell"][:])
    column = int(np.argmin(np.abs(np.asarray(fields["x_cell"][:]))))
    position = float(fields["punch_position"][snapshot])
    radius = run.scene.punch.radius
    line = np.linspace(-radius, radius, 4001)
    face = position + topography_of(run.scene.punch).heights(np.zeros_like(line), line)
    figure, axes = panels(1, height=2.9)
    axis = axes[0, 0]
    top = 1e6 * face.max() + 6.0
    axis.fill_between(1e6 * line, 1e6 * face, top, color=GREY, alpha=0.55, lw=0, label="punch")
    bottom = 1e6 * surface.min() - 5.0
    axis.fill_between(1e6 * y, bottom, 1e6 * surface[:, column], color=TURQUOISE, alpha=0.35, lw=0, label="elastomer")
    axis.plot(1e6 * y, 1e6 * surface[:, column], color=TURQUOISE, lw=1.0)
    axis.set(xlabel="y (µm), x = 0", ylabel="height (µm)", ylim=(bottom, top), xlim=1e6 * y[[0, -1]])
    axis.legend(loc="lower right", ncols=2)
    force = 1e3 * float(fields["force"][snapshot])
    caption = (
        f"Punch and surface u along x = 0 during the compression, at {fractions(run)[snapshot]:.2g} t_pl, "
        f"{force:.3g} mN; {settings_of(run)}. Heights are not to scale."
    )
    return Drawing(figure, caption)


def compliance(runs: Runs) -> Drawing:
    """The surface over the whole cell with u_inf, and the linear fit of u_inf against the force: FIG complianceCorr."""
    run = runs.one("cell")
    results, snapshot = run.results, frame_at(run, 1.0)
    fields, loop = results.fields, run.loop
    surface = results.frame("surface_displacement", snapshot)
    x = np.asarray(fields["x_cell"][:])
    # The corner and the middle of an edge, where the cell ends and begins again.
    middle = int(np.argmin(np.abs(x)))
    end = int(np.argmax(np.abs(x)))
    corner, edge = float(surface[end, end]), float(surface[middle, end])
    row = int(np.argmin(np.abs(loop.time - float(fields["time"][snapshot]))))
    far = float(loop.u_inf[row])
    fit = fit_cell_compliance(loop)
    figure, axes = panels(2, height=3.0)
    left, right = axes[0]
    left.plot(1e6 * x, 1e6 * surface[middle], color=TURQUOISE, label="u along y = 0")
    left.axhline(0.0, color=RED, lw=1.0, label="ũ(q = 0)")
    left.axhline(1e6 * far, color=RED, lw=1.0, ls=(0, (4, 2)), label="u_∞")
    left.axhline(1e6 * loop.displacement[row], color=GREY, lw=1.0, ls=":", label="d of the punch")
    left.set(xlabel="x (µm)", ylabel="height (µm)", title=f"(a) at the preload, {1e3 * loop.force[row]:.3g} mN")
    low, high = left.get_ylim()
    left.set_ylim(low, high + 0.35 * (high - low))
    left.legend(fontsize=7, ncols=2, loc="upper center")
    right.plot(1e3 * loop.force, 1e6 * loop.u_inf, ".", color=TURQUOISE, ms=3, label="run")
    span = np.array([loop.force.min(), loop.force.max()])
    label = f"F/k_cc, k_cc = {1e-3 * fit.stiffness:.3g} kN/m"
    right.plot(1e3 * span, 1e6 * span / fit.stiffness, color=OCHRE, label=label)
    right.set(xlabel="force (mN)", ylabel="u_∞ (µm)", title="(b) linear fit")
    right.legend()
    claims = [
        Claim("stiffness k_cc of the correction", "all rows of the loop", 1e-3 * fit.stiffness, "kN/m"),
        Claim("scatter about the fit, over the range of u_∞", "rms", 100 * fit.scatter / fit.span, "%"),
        Claim("6 u(L/2, L/2) − 5 u(L/2, 0) from the surface, over u_∞", "preload", (6 * corner - 5 * edge) / far),
    ]
    caption = f"Surface of the whole cell at the preload, and u_∞ of the whole loop; {settings_of(run)}."
    return Drawing(figure, caption, claims)
