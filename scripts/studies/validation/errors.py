"""pgfmd against closed forms, at full size: prints closed form, ours, error and settings, a line each.

    python -m scripts.studies.validation.errors                 all studies; about half an hour on one core
    python -m scripts.studies.validation.errors hertz jkr       some of them
    python -m scripts.studies.validation.errors --quick         on small grids, a minute
    python -m scripts.studies.validation.errors --list

The same studies on small grids, with tolerances, are the tests of tests/physics.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pgfmd.reference import flat_punch, hertz, jkr, maugis, power_law, tabor, wavy
from tests.physics.runs import (
    CONTACT_MODULUS,
    RADIUS,
    RIGID,
    SINUSOID,
    WORK_OF_ADHESION,
    pull,
    radius_of_traction,
    run,
)

from .choice import chosen

SPHERE = 10e-3
SLOW, FAST = 1e-8, 10.0


@dataclass(frozen=True)
class Line:
    """One comparison: what, with which settings, the closed form and our number, in the same unit."""

    what: str
    settings: str
    closed: float
    ours: float


def hertz_study(quick: bool) -> Iterator[Line]:
    """Force and contact radius of a sphere; overlap ever stiffer."""
    n = 128 if quick else 512
    for factor in (1, 4):
        result = run("hertz", f"grid.n={n}", f"adhesion.range_factor={factor}")
        depth = -result.preload_position
        settings = f"n={n} range_factor={factor}"
        yield Line("Hertz force [N]", settings, hertz.force(depth, SPHERE, CONTACT_MODULUS), result.state.preload)
        closed = hertz.contact_radius(depth, SPHERE)
        yield Line("Hertz contact radius [m]", settings, closed, radius_of_traction(result))


def jkr_study(quick: bool) -> Iterator[Line]:
    """Pull-off and snap-off of a sticky sphere in ever shorter ranges, with Maugis's pull-off for equal range."""
    tension = np.pi * WORK_OF_ADHESION * SPHERE
    limit = jkr.displacement_controlled_pull_off(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION)
    for n in (64, 128, 256) if quick else (128, 256, 512, 1024):
        result = run(
            "hertz", f"grid.n={n}", "adhesion.law=cosine", "adhesion.range_factor=0.04", "drive.preload=0.2 mN"
        )
        reach = result.scene.adhesion.range
        number = tabor.asperity(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION, reach)
        settings = f"n={n} range_factor=0.04 Tabor={number:.2f}"
        transition = maugis.transition_parameter(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION, WORK_OF_ADHESION / reach)
        ours = result.state.pull_off_force / tension
        yield Line("JKR pull-off [pi w R]", settings, -1.5, ours)
        closed = maugis.pull_off_force(SPHERE, WORK_OF_ADHESION, transition) / tension
        yield Line("Maugis pull-off, equal range [pi w R]", settings, closed, ours)
        last = result.before_last_jump()
        yield Line("JKR snap-off displacement [m]", settings, -limit.indentation, last.position)
        yield Line("JKR snap-off force [pi w R]", settings, limit.force / tension, last.force / tension)


def flat_study(quick: bool) -> Iterator[Line]:
    """Contact stiffness, Kendall's pull-off and the energy released there, elastic."""
    kendall = flat_punch.pull_off_force(RADIUS, CONTACT_MODULUS, WORK_OF_ADHESION)
    for n in (32, 64, 128) if quick else (64, 128, 256, 512):
        rigid = run("flat-punch", *RIGID, f"grid.n={n}", "solver.accuracy=1e-3", "drive.preload=1 mN")
        yield Line("2 a E* [N/m]", f"n={n} repulsive", 2 * RADIUS * CONTACT_MODULUS, rigid.contact_stiffness())
        sticky = run("flat-punch", "rheology.model=elastic", f"grid.n={n}")
        settings = f"n={n} range={sticky.scene.adhesion.range * 1e6:.3f} um"
        yield Line("Kendall pull-off [N]", settings, kendall, sticky.state.pull_off_force)
        released = max(row.released for row in sticky.jumps if row.phase == "retract")
        yield Line("released at pull-off [J]", settings, np.pi * RADIUS**2 * WORK_OF_ADHESION, released)


def speed_study(quick: bool) -> Iterator[Line]:
    """Work of separation at both ends of the speeds, and the audit, for E(inf)/E(0) = 4; a jump at 250."""
    work = flat_punch.work_of_separation(RADIUS, WORK_OF_ADHESION)
    for n in (64, 128) if quick else (128, 256, 512):
        for speed in (SLOW, 1e-3, FAST):
            result = pull(n, 4, speed)
            settings = f"n={n} ratio=4 v={speed:g} m/s"
            closed = work if speed in (SLOW, FAST) else np.nan
            yield Line("work of separation [J]", settings, closed, result.work_of_separation())
            energies = result.state.energies
            yield Line("audit: residual/work", settings, 0.0, energies.largest_residual / energies.work)
    n = 128 if quick else 1024
    result = pull(n, 250, 1e-6)
    energies = result.state.energies
    settings = f"n={n} ratio=250 v=1e-6 m/s jumps={len(result.jumps)}"
    yield Line("audit: residual/work", settings, 0.0, energies.largest_residual / energies.work)


def film_study(quick: bool) -> Iterator[Line]:
    """A flat punch of a = h/5.3 on a film, relative to the half-space."""
    for n in (64,) if quick else (128, 256):
        common = (*RIGID, f"grid.n={n}", "solver.accuracy=1e-3", "drive.preload=1 mN")
        half_space = run("flat-punch", *common).contact_stiffness()
        for base, ratio in (("bonded", 1.26), ("sliding", 1.16)):
            film = run("flat-punch", *common, f"substrate.thickness={5.3 * RADIUS:.9g} m", f"substrate.base={base}")
            yield Line("stiffness, film/half-space", f"n={n} {base}", ratio, film.contact_stiffness() / half_space)


def wavy_study(quick: bool) -> Iterator[Line]:
    """Contact fraction of a wave at half of the pressure that closes it."""
    wave_number = 2 * np.pi / 100e-6
    closing = wavy.full_contact_pressure(1e-6, wave_number, CONTACT_MODULUS)
    for n in (32, 64) if quick else (64, 128, 256):
        result = run(SINUSOID, f"grid.n={n}", "solver.accuracy=1e-3", f"drive.preload={0.5 * closing * 1e-8:.9g} N")
        _, _, pressing = result.phase("approach")
        closed = wavy.contact_fraction(result.state.preload / 1e-8, 1e-6, wave_number, CONTACT_MODULUS)
        yield Line("Westergaard contact fraction", f"n={n}", closed, pressing[-1] / n**2)


def power_study(quick: bool) -> Iterator[Line]:
    """Force on power-law indenters at the depth of a contact radius."""
    n = 128 if quick else 512
    for exponent, size, radius in ((1.5, 40e-3, 110e-6), (2, 10e-3, 200e-6), (3, 3e-3, 200e-6), (4, 2e-3, 200e-6)):
        result = run(
            "hertz", "punch.pattern=power", f"punch.exponent={exponent}", f"punch.curvature_radius={size} m",
            f"grid.n={n}", "drive.preload=3 mN", "solver.accuracy=3e-3",
        )  # fmt: skip
        depth = power_law.indentation(radius, size, exponent)
        # The lowest grid points, h/sqrt(2) from the axis, are z = 0, not the apex between them.
        depth -= power_law.height(result.spacing / np.sqrt(2), size, exponent)
        closed = power_law.force(radius, size, exponent, CONTACT_MODULUS)
        yield Line("power-law force [N]", f"n={n} p={exponent}", closed, result.force_at(depth, "approach"))


STUDIES: dict[str, Callable[[bool], Iterator[Line]]] = {
    "hertz": hertz_study,
    "jkr": jkr_study,
    "flat": flat_study,
    "speed": speed_study,
    "film": film_study,
    "wavy": wavy_study,
    "power": power_study,
}


def show(line: Line) -> None:
    """Prints one comparison; the error is relative, or absolute where the closed form is zero."""
    error = "" if np.isnan(line.closed) else f"{line.ours - line.closed:.4f}"
    if line.closed and not np.isnan(line.closed):
        error = f"{100 * (line.ours / line.closed - 1):+.2f} %"
    closed = "" if np.isnan(line.closed) else f"{line.closed:.6g}"
    print(f"{line.what:40s} {closed:>12s} {line.ours:12.6g} {error:>10s}   {line.settings}", flush=True)


def main() -> None:
    names, quick = chosen(__doc__, "study", STUDIES, "small grids")
    print(f"{'':40s} {'closed form':>12s} {'ours':>12s} {'error':>10s}   settings")
    for name in names:
        start = time.perf_counter()
        for line in STUDIES[name](quick):
            show(line)
        print(f"# {name}: {time.perf_counter() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main()
