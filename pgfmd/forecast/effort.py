"""Forecast of steps and transform pairs of a scene: a model with few constants, fitted to runs. No MPI.

W is the travel of the punch in the approach, or in the retraction, in ranges of adhesion rho; v is its speed. For each
of the two,

    steps = (0.01/accuracy)^q (least + rate W^w slow)
    pairs = steps (pairs_least + pairs_rate sqrt(1 + J C^m)),     C = K_0 l/E*

Steps: a snapping surface moves by about gamma/E* in its retardation time lambda, and the steps resolve this speed:
slow = (gamma/(E* v lambda))^p. If it jumps in zero time, slow = 1. Without attraction nothing snaps, and slow = x/(1 +
x), where x is the duration of the motion in retardation times. Pairs: the number of iterations of the conjugate
gradients increases with the compliance J = J(dt) of the elastomer in a step, relative to that of the law, with its
stiffness K_0 over the size l of a contact patch.

Steps and pairs of flat punches hardly depend on the indentation, but on how far the elastomer is stretched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pgfmd import coarsening
from pgfmd.physics.adhesion.registry import law_of, length_of
from pgfmd.run_ahead import coarse_scenes
from pgfmd.scene_objects import automatic_range, machine_compliance, quasistatic_compliance, relaxation_of
from pgfmd.schemes import registry
from pgfmd.symmetry import expected

from .effort_constants import FITTED, Numbers
from .estimate import depth_of, guessed_seconds, pair_cost, pair_seconds
from .indentation import Travel, pull_off_height, travels_of

if TYPE_CHECKING:
    from pgfmd.physics.rheology import CreepSeries
    from pgfmd.scene import Scene

JUMP_FACTOR = 0.38
"""A flat punch jumps in zero time if kappa_inf is below this factor times n, at the automatic range."""
EXPLICIT_SPREAD = 1.5
"""Stated factor for explicit steps, whose length is known: that of the duration of the programme."""
FLAT_SPREAD = 2.0
"""The same for flat punches, which stretch the elastomer by a distance that depends on their speed."""
UNLIKE = 2.0
"""Additional factor for scenes unlike those that the constants were fitted to."""
WITH_SPRING = "a spring or a dead load"
"""Reason for scenes whose machine is not rigid: the travel of its spring follows from forces that are estimates."""
COARSEST = 0.1
"""Coarsest accuracy at which the fit is taken to hold."""
FINEST = 1e-4
"""Finest accuracy at which the fit is taken to hold."""


@dataclass(frozen=True)
class Effort:
    """Expected steps and transform pairs of a run, right within a factor of `spread` in 19 of 20 scenes.

    pair_seconds: measures the approximate time of a pair on this machine. cost: time of the run per pair, relative to
    that. approach: numbers of steps and pairs before the preload. unlike: why the spread is larger than that of the
    fit, empty if it is not. kind: of the scene.
    """

    steps: float
    pairs: float
    pair_seconds: Callable[[], float] = field(compare=False)
    cost: float = 1.0
    spread: float = 3.0
    approach: tuple[float, float] = (0.0, 0.0)
    unlike: str = ""
    kind: str = "explicit"

    @property
    def seconds(self) -> float:
        """Wall time on one rank of this machine."""
        return guessed_seconds(self.pairs, self.pair_seconds(), self.cost)


@dataclass(frozen=True)
class Stroke:
    """The approach or the retraction of the punch, with the variables of the model.

    length: travel in ranges of adhesion. time: duration [s]. inward: whether it is the approach. accuracy: of its
    steps.
    slow: speed of a snapping surface relative to that of the punch, or its replacement without attraction; 1 without
    viscosity. creep: compliance J at a time [s], relative to the static one. stiffness: K_0 l/E*, stiffness of the law
    relative to that of the relaxed elastomer, over the size l of a contact patch.
    """

    length: float
    time: float
    inward: bool
    accuracy: float
    slow: float
    creep: Callable[[float], float]
    stiffness: float


def jump_threshold(scene: Scene) -> float:
    """kappa_inf below which a flat punch jumps in zero time: 0.38 n at the automatic range, more at a shorter one."""
    return JUMP_FACTOR * scene.grid.n * (automatic_range(scene) / scene.adhesion.range) ** 2


def kind_of(scene: Scene) -> str:
    """The kind of a scene: a key of FITTED."""
    if not scene.adhesion.attractive:
        return "repulsive"
    shape = "flat, " if scene.punch.pattern == "flat" else ""
    if relaxation_of(scene).elements:
        # Long waves then take no pairs.
        return f"{shape}viscoelastic{', two grids' if coarsening.expected(scene).factor else ''}"
    # Only its contact line jumps.
    shape = "round, " if scene.punch.pattern in ("sphere", "power") else shape
    if registry.scheme_of(scene).timeless:
        # The threshold is for kappa_inf, the stiffness relative to the relaxed body.
        stiff = 1.0 / quasistatic_compliance(scene) > jump_threshold(scene)
        return f"{shape}{'smooth' if stiff else 'quasi-static'}"
    return f"{shape}elastic"


def strokes_of(scene: Scene) -> tuple[Stroke, Stroke]:
    """Approach and retraction."""
    drive, reach = scene.drive, length_of(scene.adhesion)
    start = max(drive.clearance, 0.0) if scene.adhesion.attractive else 0.0
    into, out = travels_of(scene, start)
    flat = scene.punch.pattern == "flat"
    lengths = (start + reach, pull_off_height(scene)) if flat else (into.length, out.length)
    creep, stiffness, accuracy = relaxation_of(scene).to_creep(), stiffness_of_law(scene), scene.solver.accuracy

    def softness(time: float) -> float:
        if not creep.elements:
            return quasistatic_compliance(scene)
        return float(creep.J_inf + (creep.J * -np.expm1(-time / creep.retardation_times)).sum())

    def stroke(length: float, travel: Travel, inward: bool) -> Stroke:
        slow = slowness(scene, creep, travel.time, travel.speed)
        return Stroke(length / reach, travel.time, inward, accuracy, slow, softness, stiffness)

    return stroke(lengths[0], into, True), stroke(lengths[1], out, False)


def slowness(scene: Scene, creep: CreepSeries, time: float, speed: float) -> float:
    """The variable `slow` of Stroke, for a motion of this duration [s] and speed [m/s]. creep: the CreepSeries of the
    scene."""
    if not creep.elements:
        return 1.0
    # For a broad spectrum, the mean of the logarithms of the times, weighted by compliance.
    middle = math.exp(float((creep.J * np.log(creep.retardation_times)).sum() / creep.J.sum()))
    if not scene.adhesion.attractive:
        return time / middle / (1.0 + time / middle)
    return scene.adhesion.work_of_adhesion / (scene.substrate.contact_modulus * speed * middle)


def effort_of(scene: Scene) -> Effort:
    """Steps and transform pairs of a run."""
    return registry.scheme_of(scene).effort_of(scene)


def fitted_effort(scene: Scene) -> Effort:
    """The same for schemes with an accuracy, from the fitted constants."""
    found = FITTED[kind_of(scene)]
    (steps_in, pairs_in), (steps_out, pairs_out) = (counts_of(stroke, found) for stroke in strokes_of(scene))
    unlike, steps, pairs = ", ".join(_unlike(scene)), steps_in + steps_out, pairs_in + pairs_out
    if scene.drive.step:
        # Not at the top: few scenes have a programme.
        from .programme import size_of

        size = size_of(scene)
        told = pairs / steps * size.steps
        steps, pairs = size.loops * steps + size.steps, size.loops * pairs + told
    return Effort(
        steps, pairs, partial(pair_seconds, scene), pair_cost(scene),
        found.spread * (UNLIKE if unlike else 1.0), (steps_in, pairs_in), unlike, kind_of(scene),
    )  # fmt: skip


def ahead_of(scene: Scene) -> list[tuple[Scene, float]]:
    """The coarse approaches before a run (run_ahead.py), each with its expected transform pairs."""
    return [(coarse, effort_of(coarse).approach[1]) for coarse in coarse_scenes(scene)]


def ahead_summary(scene: Scene) -> tuple[str, str]:
    """The coarse approaches and their expected work relative to the run, as texts; both empty if there are none."""
    ahead = ahead_of(scene)
    if not ahead:
        return "", ""
    own, work = effort_of(scene), _work_of_pair(scene)
    pairs, share = sum(pairs for _, pairs in ahead), sum(pairs * _work_of_pair(coarse) for coarse, pairs in ahead)
    count = "a coarse approach" if len(ahead) == 1 else f"{len(ahead)} coarse approaches"
    what = f"{count}, n = {ahead[0][0].grid.n}, {float(f'{pairs:.2g}'):g} pairs"
    return what, f"{100.0 * share / (own.pairs * work):.1g} % of the work of the run"


def _work_of_pair(scene: Scene) -> float:
    """The arithmetic work of a pair in arbitrary units: n^2 log n, less with mirror symmetry."""
    n = scene.grid.n
    return n**2 * math.log(n) / 2 ** len(expected(scene).mirror) * pair_cost(scene)


def counts_of(stroke: Stroke, numbers: Numbers) -> tuple[float, float]:
    """Steps and pairs of the approach or the retraction."""
    least, rate, pairs_rate = (
        pair[0 if stroke.inward else 1] for pair in (numbers.least, numbers.rate, numbers.pairs_rate)
    )
    steps = (1e-2 / stroke.accuracy) ** numbers.refinement * (
        least + rate * stroke.length**numbers.travel * stroke.slow**numbers.slow
    )
    root = math.sqrt(1.0 + stroke.creep(stroke.time / steps) * stroke.stiffness**numbers.stiff)
    return steps, steps * (numbers.pairs_least + pairs_rate * root)


def stiffness_of_law(scene: Scene) -> float:
    """K_0 l/E*, see Stroke. The size l: half a wavelength, the radius of a sphere's contact, or that of the punch."""
    punch = scene.punch
    if punch.pattern in ("sphere", "power"):
        size = min(punch.outline, math.sqrt(punch.curvature_radius * depth_of(scene)))
    elif punch.wavelength:
        size = 0.5 * punch.wavelength
    else:
        size = punch.radius or 0.5 * scene.grid.length
    return law_of(scene.adhesion).stiffness * size / scene.substrate.contact_modulus


def _unlike(scene: Scene) -> Iterator[str]:
    """Features of a scene that none of the fitted scenes has."""
    series = relaxation_of(scene)
    if scene.punch.pattern == "file":
        yield "a measured face"
    if scene.punch.pattern == "rough":
        yield "a random face"
    if not FINEST <= scene.solver.accuracy <= COARSEST:
        yield "its accuracy"
    if math.isfinite(scene.substrate.thickness):
        yield "a film"
    if machine_compliance(scene):
        yield WITH_SPRING
    if series.elements and series.to_creep().J_inf > 0.1:
        yield "an elastomer that is nearly elastic"
    if scene.drive.dwell > 0.0 and series.elements:
        yield "a dwell"
    if scene.drive.step:
        yield "a programme of steps"


def effort_of_steps(scene: Scene, step: float, pair: float, cost: float) -> Effort:
    """The same for explicit steps of known length [s] with one pair each. The duration of the programme follows from
    the indentation, the stretch due to adhesion, and the travel of a machine's spring. pair: time of a pair, relative to `pair_seconds`; cost: as in
    Effort."""
    into, out = (travel.time for travel in travels_of(scene))
    duration = into + (out + scene.drive.turn_time + scene.drive.dwell)
    if scene.drive.step:
        from .programme import size_of

        size = size_of(scene)
        duration = size.loops * (into + out) + size.time
    steps = duration / step
    spread = FLAT_SPREAD if scene.punch.pattern == "flat" else EXPLICIT_SPREAD
    unlike = WITH_SPRING if machine_compliance(scene) else ""
    return Effort(
        steps, steps, lambda: pair * pair_seconds(scene), cost, spread * (UNLIKE if unlike else 1.0),
        (into / step, into / step), unlike,
    )  # fmt: skip
