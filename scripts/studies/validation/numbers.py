"""The numbers of the paper that follow from its formulas."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pgfmd.physics.adhesion.base import range_of_adhesion
from pgfmd.physics.rheology import PronySeries
from pgfmd.reference import corrugation, tabor
from pgfmd.scene import load_scene

from .drawing import GREY, Line, ours, panels


def _numbers() -> Iterator[tuple[Line, float]]:
    """What the paper prints, ours, and half a unit of the last digit it prints."""
    tri, hexagonal = load_scene("tri-tack"), load_scene("hex-tack")
    modulus, work, radius = tri.substrate.contact_modulus, tri.adhesion.work_of_adhesion, tri.punch.radius
    q = 2 * math.pi / tri.punch.wavelength
    ranges = {2048: 0.264e-6, 4096: 0.187e-6}
    for n, printed in ranges.items():
        found = range_of_adhesion(work, modulus, 0.156, 2 * math.pi * n / tri.grid.length)
        yield Line("range of adhesion [µm]", f"n = {n}, c = 0.156", printed * 1e6, found * 1e6), 0.0005
    for n, printed in ((2048, 10.0), (4096, 14.0)):
        found = tabor.flat_punch(radius, modulus, work, ranges[n])
        yield Line("Tabor number of the flat punch", f"range of n = {n}", printed, found), 0.5
    for name, scene, printed in (("tri", tri, 163.0), ("hex", hexagonal, 142.0)):
        found = corrugation.summit_radius(name, scene.punch.amplitude, q)
        yield Line("radius of the summits [µm]", name, printed, found * 1e6), 0.5
        found = tabor.asperity(found, modulus, work, ranges[4096])
        yield Line("Tabor number of a summit", f"{name}, range of n = 4096", 2.0, found), 0.5
    for name, scene, printed, half in (("tri", tri, 0.32, 0.005), ("hex", hexagonal, 0.061, 0.0005)):
        found = corrugation.reduced_surface_energy(scene.punch.amplitude, q, modulus, work)
        yield Line("surface energy / energy of full contact", name, printed, found), half
    model = PronySeries.geometric(250, 40e-6, elements=5, time_ratio=6, exponent=0.8)
    decades = math.log10(6 * model.tau[0] / model.tau[-1])
    yield Line("decades covered by five elements", "tau ratio 6", 4.0, decades), 0.5


def paper(quick: bool):
    """The paper's printed numbers against those of its formulas, as the shipped scenes have them."""
    figure, (axis,) = panels(1, 3.2)
    found = list(_numbers())
    names = [f"{line.what.split(' [')[0]}, {line.settings}" for line, _ in found]
    for place, (line, half) in enumerate(found):
        width = 100 * half / line.closed
        axis.plot([-width, width], [place, place], color=GREY, lw=5, alpha=0.5, solid_capstyle="butt")
        ours(axis, [100 * line.error], [place])
    axis.axvline(0.0, color="black", lw=0.8)
    axis.set_yticks(range(len(found)), names, fontsize=7.5)
    axis.invert_yaxis()
    axis.set(xlim=(-4, 4), xlabel="ours against the printed value [%]")
    axis.set_title("the paper's numbers (grey: rounding of the printed value)")
    return figure, [line for line, _ in found]
