"""Moduli and responses of the rheological models. No runs."""

from __future__ import annotations

import numpy as np

from pgfmd.physics.rheology import PronySeries
from pgfmd.plots.rheology import draw_creep, draw_modulus
from pgfmd.reference.prony import gfmd_creep

from .drawing import COLOURS, GREY, Claim, Drawing, panels
from .pool import Runs

MODELS = {
    "model 1": PronySeries.single(250.0, 400e-6),
    "model 2": PronySeries.geometric(8.0, 40e-6, 5, 6.0, 0.8),
    "model 3": PronySeries.geometric(250.0, 40e-6, 5, 6.0, 0.8),
    "broad (ours)": PronySeries.geometric(1000.0, 9.97e-9, 20, 2.6366509, 0.5),
}


def exponent_of(series: PronySeries) -> float:
    """Slope of the storage modulus in double logarithmic axes where it is the geometric mean of its limits."""
    omega = np.geomspace(1e-3 / series.tau[0], 1e3 / series.tau[-1], 20001)
    storage = np.log(series.storage(omega))
    at = int(np.searchsorted(storage, 0.5 * np.log(series.kappa_inf)))
    return float((storage[at + 1] - storage[at - 1]) / np.log(omega[at + 1] / omega[at - 1]))


def response(runs: Runs) -> Drawing:
    """Stiffness of the five-element model and its response to a point force, as in FIG maxwellStuff."""
    series = MODELS["model 3"]
    figure, axes = panels(2, width=9.0, height=4.1)
    draw_modulus(axes[0, 0], series)
    draw_creep(axes[0, 1], series)
    time = np.geomspace(series.tau[-1], 20 * series.to_creep().retardation_times[0], 2000)
    away = np.abs(gfmd_creep(time, series, 2 * np.pi / series.tau[-1]) / series.creep(time) - 1)
    claims = [
        Claim("exponent β of E′ at its middle", "N = 5", exponent_of(series), "", "0.8", 0.75, 0.85),
        Claim("exponent β of E′ at its middle", "N = 1", exponent_of(MODELS["model 1"]), "", "2", 1.75, 2.25),
    ]
    for since in (1, 5):
        settings = f"ω τ_min = 2π, worst after {since} τ_min"
        worst = 100 * float(away[time >= since * series.tau[-1]].max())
        claims.append(Claim("response with inertia against the ideal one", settings, worst, "%", "quite accurate"))
    caption = (
        "Five elements, τ ratio 6, weights 6^0.8, κ_∞ = 250, τ_min = 40 µs. (b) has the masses of the paper's scheme."
    )
    return Drawing(figure, caption, claims)


def moduli(runs: Runs) -> Drawing:
    """Moduli of the three models, as in FIG FDrheo a, and the broad spectrum beyond the paper."""
    figure, axes = panels(2, height=3.1, sharex=True)
    omega = np.geomspace(1e-2, 1e9, 1200)
    for (name, series), colour in zip(MODELS.items(), COLOURS, strict=False):
        style = {"color": colour, "ls": (0, (4, 2)) if "ours" in name else "-", "label": name}
        axes[0, 0].plot(omega, series.storage(omega), **style)
        axes[0, 1].plot(omega, series.loss(omega), **style)
    for axis, title in zip(axes[0], ("storage modulus E′/E(0)", "loss modulus E″/E(0)"), strict=True):
        axis.axhline(1.0, color=GREY, lw=0.6)
        axis.set(xscale="log", yscale="log", xlabel="angular frequency ω (rad/s)", ylabel=title, ylim=(0.03, 2000))
    axes[0, 0].legend()
    claims = [
        Claim("Σ κ_n τ_n, the viscosity of slow motion over E(0)", name, 1e3 * float(series.kappa @ series.tau), "ms")
        for name, series in MODELS.items()
    ]
    return Drawing(figure, "Moduli of the models at the paper's relaxation times (n = 2048).", claims)
