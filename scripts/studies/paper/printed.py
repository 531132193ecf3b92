"""The punch: its surfaces from above, and the profile of a printed one."""

from __future__ import annotations

import math

import numpy as np

from pgfmd.parts import topography_of
from pgfmd.scene import load_scene

from .drawing import GREY, RED, TURQUOISE, Claim, Drawing, panels
from .pool import Runs

CHOSEN_CURVATURE = 0.1
"""Radius [m] of the macroscopic curvature in the figure of the profile. Our choice: the paper gives no number."""
LAYER_STEP = 0.2e-6
POINTS = 601


def surfaces(runs: Runs) -> Drawing:
    """Both patterns from above, as in FIG surfs."""
    figure, axes = panels(2, height=3.2)
    claims = []
    names = {"tri-tack": "(a) triangular", "hex-tack": "(b) hexagonal"}
    told = {"tri-tack": (163.0, 2), "hex-tack": (142.0, 2)}
    for axis, (source, title) in zip(axes[0], names.items(), strict=True):
        punch = load_scene(source).punch
        line = np.linspace(-punch.radius, punch.radius, POINTS)
        x, y = np.meshgrid(line, line)
        inside = np.hypot(x, y) <= punch.radius
        height = np.where(inside, topography_of(punch).heights(x, y), np.nan)
        extent = 1e6 * punch.radius * np.array([-1, 1, -1, 1])
        image = axis.imshow(1e6 * height, origin="lower", extent=extent, cmap="gray_r")
        axis.set(xlabel="x (µm)", ylabel="y (µm)", title=title)
        figure.colorbar(image, ax=axis, label="z (µm), summits 0", shrink=0.85)
        word = title.split()[1]
        value, _ = told[source]
        radius = 1e6 * topography_of(punch).summit_radius
        claims.append(Claim("radius of the summits", word, radius, "µm", f"{value:g}", value - 0.5, value + 0.5))
        half = 0.5e6 * float(np.nanmax(height) - np.nanmin(height))
        amplitude = 1e6 * punch.amplitude
        both = (f"{amplitude:g}", amplitude, amplitude)
        claims.append(Claim("half of highest minus lowest point", word, half, "µm", *both))
    return Drawing(figure, "The lower face of the punch; dark is low and touches last, white touches first.", claims)


def profile(runs: Runs) -> Drawing:
    """Deviation from the ideal profile and absolute heights along a row of summits, as in FIG printCurv."""
    ideal = load_scene("tri-tack").punch
    curved = ideal.model_copy(update={"curvature_radius": CHOSEN_CURVATURE})
    layered = curved.model_copy(update={"layer_step": LAYER_STEP})
    x = np.linspace(-ideal.radius, ideal.radius, 3001)
    # A row of summits, as near to the axis as there is one.
    y = math.sqrt(3) / 4 * ideal.wavelength
    x = x[np.hypot(x, y) <= ideal.radius]
    heights = {name: 1e6 * topography_of(punch).heights(x, y)
               for name, punch in (("ideal", ideal), ("curved", curved), ("layered", layered))}  # fmt: skip
    figure, axes = panels(2, height=3.0)
    left, right = axes[0]
    left.plot(1e6 * x, heights["layered"] - heights["ideal"], color=GREY, lw=0.7, label="with layers of 0.2 µm")
    left.plot(1e6 * x, heights["curved"] - heights["ideal"], color=RED, label="curvature alone")
    left.set(xlabel="x (µm)", ylabel="deviation from the ideal profile (µm)", title="(a) deviation")
    left.legend()
    right.plot(1e6 * x, heights["layered"], color=GREY, lw=0.7, label="curved, in layers")
    right.plot(1e6 * x, heights["curved"], color=RED, label="curved")
    right.plot(1e6 * x, heights["ideal"], color=TURQUOISE, ls=(0, (4, 2)), label="ideal")
    right.set(xlabel="x (µm)", ylabel="height z (µm)", title="(b) absolute heights")
    right.set_ylim(top=1.35 * heights["layered"].max())
    right.legend(ncols=3, loc="upper center", fontsize=7, handlelength=1.3, columnspacing=1.0)
    rim = 1e6 * ideal.radius**2 / (2 * CHOSEN_CURVATURE)
    caption = (
        f"A row of summits of the triangular punch with a macroscopic curvature of {1e3 * CHOSEN_CURVATURE:g} mm, "
        "our choice, and printing layers."
    )
    steps = float(np.abs(heights["layered"] - heights["curved"]).max())
    return Drawing(figure, caption, [
        Claim("the curvature lifts the rim by", f"R = {1e3 * CHOSEN_CURVATURE:g} mm", rim, "µm"),
        Claim("largest deviation by layers", "layers of 0.2 µm", steps, "µm"),
    ])  # fmt: skip
