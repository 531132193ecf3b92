"""Pictures of a rheology: modulus and creep of a series, like the paper's figure, and a fit to DMA data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pgfmd.characterisation.moduli_columns import ABSOLUTE_ZERO
from pgfmd.characterisation.prony_fit import moduli_of
from pgfmd.characterisation.relaxation_fit import RelaxationFit
from pgfmd.physics.rheology import PronySeries
from pgfmd.reference.prony import gfmd_creep

from .drawing import GREY, OCHRE, RED, TURQUOISE, VIOLET, literal, new_figure, picture, signed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pgfmd.characterisation.rheology_table import Material
    from pgfmd.scene import Scene

GUIDES = {0.8: "-", 0.5: (0, (5, 1.5))}
"""The power laws of the paper's figure and their line styles."""
GFMD_PHASES = {1: OCHRE, 2: RED, 4: VIOLET, 8: TURQUOISE}
"""omega_GFMD tau_min in units of pi, and colour. The paper uses 2 pi."""
MOST_TEMPERATURES = 8


@picture
def plot_rheology(source: Scene | PronySeries, title: str = "") -> Figure:
    """The modulus ratio against frequency, and the creep of target and implemented model against time.

    source: a scene, whose elastomer is drawn, or a series. title: of the picture; by default that of the scene. Raises
    ValueError for a material without a relaxation.
    """
    series, title = (source, title) if isinstance(source, PronySeries) else (_series_of(source), title or source.title)
    if not series.elements:
        raise ValueError("an elastic material has one modulus at all frequencies: there is nothing to draw")
    figure = new_figure(9.0, 4.1)
    left, right = figure.subplots(1, 2)
    draw_modulus(left, series)
    draw_creep(right, series)
    if title:
        figure.suptitle(literal(title), fontsize=9.5)
    return figure


def _series_of(scene: Scene) -> PronySeries:
    from pgfmd.scene_objects import series_of

    return series_of(scene.rheology)


def draw_modulus(axis: Axes, series: PronySeries) -> None:
    """Storage and loss modulus over E(0), the contribution of each element to the storage modulus, and power laws
    through the middle."""
    omega = np.geomspace(1e-2 / series.tau[0], 1e2 / series.tau[-1], 600)
    storage, loss = series.storage(omega), series.loss(omega)
    axis.plot(omega, storage, color="black", label="storage, E′/E(0)", zorder=3)
    axis.plot(omega, loss, color=RED, label="loss, E″/E(0)", zorder=2.5)
    for number, (weight, time) in enumerate(zip(series.kappa, series.tau, strict=True)):
        x = omega * time
        label = "storage of one element" if number == 0 else None
        axis.plot(omega, weight * x**2 / (1 + x**2), ":", color=TURQUOISE, linewidth=0.9, label=label)
    # With space above the curves for the legend.
    bottom, top = 0.3 * min(1.0, float(series.kappa.min())), 12 * series.kappa_inf
    # Through the frequency where E' is the geometric mean of its limits, as in the paper.
    middle = np.sqrt(series.kappa_inf)
    at = np.exp(np.interp(np.log(middle), np.log(storage), np.log(omega)))
    for exponent, line in GUIDES.items():
        values = middle * (omega / at) ** exponent
        shown = (values > 0.6) & (values < 1.6 * series.kappa_inf)
        label = f"power law $\\omega^{{{exponent}}}$"
        axis.plot(omega[shown], values[shown], color=GREY, linestyle=line, linewidth=1.1, label=label, zorder=1)
    axis.set(xscale="log", yscale="log", xlim=omega[[0, -1]], ylim=(max(bottom, 1e-2), top))
    axis.set(xlabel="angular frequency ω (rad/s)", ylabel="modulus over relaxed modulus", title="(a) modulus")
    axis.legend(loc="upper left")


def draw_creep(axis: Axes, series: PronySeries) -> None:
    """Response to a force switched on at time 0, without and with auxiliary masses and dampers."""
    shortest = float(series.tau[-1])
    creep = series.to_creep()
    time = np.geomspace(3e-2 * shortest, 20 * creep.retardation_times[0], 600)
    axis.plot(time, creep.creep(time), color="black", linewidth=1.8, label="target")
    for phase, colour in GFMD_PHASES.items():
        response = gfmd_creep(time, series, phase * np.pi / shortest)
        label = rf"$\omega_\mathrm{{GFMD}}\,\tau_\mathrm{{min}} = {phase if phase > 1 else ''}\pi$"
        axis.plot(time, response, color=colour, linestyle=(0, (4, 2)), linewidth=1.2, label=label)
    axis.axvline(shortest, color="0.8", linewidth=0.8, zorder=0)
    axis.annotate(r" $\tau_\mathrm{min}$", (shortest, 1.0), xycoords=("data", "axes fraction"), va="top", color=GREY)
    axis.set(xscale="log", yscale="log", xlim=time[[0, -1]], ylim=(0.2 / series.kappa_inf, 2.0))
    axis.set(xlabel="time since the force was switched on (s)", ylabel="displacement over its final value")
    axis.set_title("(b) response to a point force")
    axis.legend(loc="lower right")


@picture
def plot_fit(material: Material) -> Figure:
    """A fit of `fit_prony`: moduli (MPa) against angular frequency, or a relaxation against time. Points are measured,
    lines are fitted. Below, the relative misfit."""
    if isinstance(material.fit, RelaxationFit):
        return _relaxation_figure(material.fit)
    fit, figure = material.fit, new_figure(5.6, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    # The master curve is sorted, so the temperatures of its points are taken from the sweeps.
    colours = _colours(len(material.sweeps))
    for sweep, shift, colour in zip(material.sweeps, material.shifts(), colours, strict=True):
        omega = sweep.omega * 10**shift
        wlf = material.wlf
        scale = sweep.kelvin / wlf.reference_temperature if material.vertical and wlf else 1.0
        label = f"{signed(sweep.temperature + ABSOLUTE_ZERO)} °C" if sweep.temperature is not None else "measured"
        upper.plot(omega, sweep.storage / scale / 1e6, "o", color=colour, markersize=3.5, label=label)
        viscous = sweep.loss > 0
        upper.plot(omega[viscous], sweep.loss[viscous] / scale / 1e6, "s", color=colour, markersize=3.5, mfc="none")
    omega = np.geomspace(fit.omega[0], fit.omega[-1], 600)
    for values, line, label in zip(moduli_of(fit, omega), ("-", (0, (4, 2))), ("fit, E′", "fit, E″"), strict=True):
        upper.plot(omega, values / 1e6, color="black", linestyle=line, linewidth=1.0, label=label)
    upper.set(xscale="log", yscale="log", ylabel="E′ (filled), E″ (open) (MPa)")
    smallest = min(fit.storage.min(), fit.loss[fit.loss > 0].min(initial=np.inf))
    upper.set_ylim(bottom=0.4 * smallest / 1e6)
    upper.set_title(f"{fit.series.elements} elements, misfit {100 * fit.rms:.2g} % rms", loc="left")
    handles, labels = upper.get_legend_handles_labels()
    if len(handles) > MOST_TEMPERATURES + 2:
        kept = [*np.linspace(0, len(handles) - 3, MOST_TEMPERATURES).round().astype(int), -2, -1]
        handles, labels = [handles[k] for k in kept], [labels[k] for k in kept]
    upper.legend(handles, labels, loc="best", ncols=2 if len(handles) > 5 else 1)
    lower.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    lower.plot(fit.omega, 100 * fit.misfit[0], "o", color="0.35", markersize=2.5)
    lower.plot(fit.omega, 100 * fit.misfit[1], "s", color="0.35", markersize=2.5, mfc="none")
    lower.set(xlabel="angular frequency ω (rad/s)", ylabel="misfit (%)")
    if material.wlf is not None:
        celsius = signed(material.wlf.reference_temperature + ABSOLUTE_ZERO)
        lower.set_xlabel(f"angular frequency ω $a_T$ (rad/s) at {celsius} °C")
    figure.align_ylabels()
    return figure


def _relaxation_figure(fit: RelaxationFit) -> Figure:
    """The relaxation E(t) [MPa] against time, and the misfit."""
    figure = new_figure(5.6, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    time = np.geomspace(fit.time[0], fit.time[-1], 600)
    upper.plot(fit.time, fit.modulus / 1e6, "o", color=TURQUOISE, markersize=3.5, label="measured")
    upper.plot(time, fit.static_modulus * fit.series.relaxation(time) / 1e6, color="black", linewidth=1.0, label="fit")
    upper.set(xscale="log", yscale="log", ylabel="E(t) (MPa)")
    upper.set_title(f"{fit.series.elements} elements, misfit {100 * fit.rms:.2g} % rms", loc="left")
    upper.legend(loc="best")
    lower.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    lower.plot(fit.time, 100 * fit.misfit, "o", color="0.35", markersize=2.5)
    lower.set(xlabel="time since the strain was applied (s)", ylabel="misfit (%)")
    figure.align_ylabels()
    return figure


def _colours(count: int) -> list:
    """One colour for a single sweep; from violet (cold) to green for several."""
    if count == 1:
        return [TURQUOISE]
    from matplotlib import colormaps

    # Not from cmcrameri, which loads pyplot. The palest end is hard to see on white.
    return [colormaps["viridis"](value) for value in np.linspace(0.0, 0.85, count)]
