"""What a scene will cost: memory from the arrays that a run allocates, steps and transforms from an empirical rule.

No MPI; nothing large is allocated.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from pgfmd.parts import (
    inertia_of_scene, quasistatic_compliance, relaxation_of, series_of, topography_of, transform_side,
)  # fmt: skip
from pgfmd.physics.heightfile import map_bytes
from pgfmd.reference import flat_punch, hertz
from pgfmd.solver.grid import PunchPoints
from pgfmd.symmetry import expected, points_of

PROGRAM_BYTES = 245e6
"""Python, compiled kernels and libraries on every rank: peak resident memory less the fields, with 1 and 2 ranks."""
SINGLE_PAIR = 0.63
"""Time of a transform pair in single precision, relative to one in double: 0.54 to 0.75 for n = 192 to 2048."""
OUTSIDE = 2.0 / 3.0
"""Time outside the transforms, relative to that of pairs in double precision, which are about 60 % of a run."""
SMOOTH = 0.1
"""E(0)/E of a quasi-static run up to which the surface does not jump from one row of grid points to the next."""


@dataclass(frozen=True)
class Memory:
    """Bytes of one rank's arrays.

    points: vectors over the punch, of which `state` belong to the State. transform: its arrays. start: the most at any
    time before the first step, what stays included.
    """

    points: float
    transform: float
    state: float
    start: float

    @property
    def running(self) -> float:
        """While steps are made."""
        return self.points + self.transform

    @property
    def peak(self) -> float:
        """The most at any time."""
        return max(self.running, self.start)


def vectors_of(elements: int, audit: bool, periodic: bool, order: int = 2, rough: float = 1.0) -> tuple[float, float]:
    """Numbers that a run keeps for every point under the punch: (state, everything else).

    State: u, w, f, two past u and w; N branches; their N images where energies are followed. Scheme: u, w, f, history a
    stage, and a fifth with energies; two stages, one where elastic or of first order. Newton: heights and f, and K, r,
    s, t, p, y, z, of `rough` the size. Weights of the far field.
    """
    stages = order if elements else 1
    return 7 + elements * (1 + audit), stages * (4 + audit) + 2 + 7 * rough + periodic


def punch_points(scene) -> PunchPoints:
    """The points under the punch as a single rank would own them, all of them."""
    return points_of(scene, "")


def largest_share(points: PunchPoints, ranks: int) -> int:
    """Points of the rank that has most of them: under a round punch, the rows in the middle are longer."""
    ends = [sum(rows) for rows in points.shares_among(ranks)]
    return int(np.diff(points.offset[ends], prepend=0).max())


def memory_of(scene, ranks: int = 1) -> Memory:
    """Memory of the rank with the largest share, out of `ranks`.

    Transform: G0, (columns, n/2 + 1), and the half-transformed columns, complex, (nb, columns), where the ranks share
    memory; messages between nodes take about as much again. The weights of the far field are made beside it by another transform, without G0, and
    the kernel of a free surface is held by rows, and with more than one rank by columns, of (n/2 + 1, n/2 + 1).
    """
    if scene.solver.scheme == "gfmd":
        return _gfmd_memory(scene, ranks)
    points = points_of(scene, expected(scene).mirror)
    rows, columns, width, multiplier = _transform_of(scene, points, ranks)
    periodic = scene.substrate.boundary == "periodic"
    precision = scene.solver.precision
    size, rough = 4.0 if precision == "single" else 8.0, 0.5 if precision == "mixed" else 1.0
    if scene.solver.scheme == "quasistatic":
        # The softest mode and its dual in the State, and as they were before the step; in the scheme u, w and zeros for
        # the history.
        counts = 7 + 2 * rough, 3 + 2 + 9 * rough + periodic
    else:
        elements = series_of(scene.rheology).elements
        counts = vectors_of(elements, scene.output.energy, periodic, scene.solver.order, rough)
    # With patches, the traction before each step: jumps are placed by it.
    counts = counts[0], counts[1] + scene.output.patches
    most = largest_share(points, ranks)
    state, rest = (size * most * count for count in counts)
    halves = 2.0 * rows * columns
    transform = (multiplier + halves) * (size + (4.0 if precision == "mixed" else 0.0))
    heights = _map_bytes(scene.punch)
    solver = size * (2.0 + 7.0 * rough) * most
    if periodic:
        # By now there are Newton's vectors; the weights are in double precision.
        start = max(heights, solver + 8.0 * (2.0 * rows * math.ceil(width / ranks) + most))
    else:
        kernel = 8.0 * (width * math.ceil(width / ranks) + (multiplier if ranks > 1 else 0.0))
        start = max(heights, solver, kernel)
    start += transform
    if points.mirror and scene.output.surface:
        # The surface of the whole cell is that of the whole punch, whose transform is made for it.
        rows, columns, _, multiplier = _transform_of(scene, points.whole, ranks)
        start = max(start, state + rest + transform + 8.0 * (multiplier + 2.0 * rows * columns))
    return Memory(state + rest, transform, state, start)


def _transform_of(scene, points: PunchPoints, ranks: int) -> tuple[int, int, int, float]:
    """Rows of all ranks; complex columns of one of them, out of `ranks`; numbers that a column of G0 has, and all of its
    columns."""
    width = transform_side(scene, points.nb, mirror=points.mirror) // 2 + 1
    columns = math.ceil((width // 2 if points.mirror else width) / ranks)
    # Of mirror images, a complex column is two real ones.
    return points.nb - points.top, columns, width, float(columns * width * (2 if points.mirror else 1))


def _map_bytes(punch) -> float:
    """A height map while heights are taken from it."""
    return map_bytes(punch.file, topography_of(punch).file_order) if punch.pattern == "file" else 0.0


def _gfmd_memory(scene, ranks: int) -> Memory:
    """The same for whole-plane modes: u, its velocity and N elements, complex, (n, columns), and twice G0 on half of
    them; heights, u and f of the points, of which one rank may hold all; the transform's real plane, and two spectral
    arrays before and after the transpose."""
    n, points = scene.grid.n, punch_points(scene)
    columns, rows = math.ceil((n // 2 + 1) / ranks), math.ceil(n / ranks)
    spectral = 16.0 * n * columns
    state = (2 + series_of(scene.rheology).elements) * spectral
    mine = 8.0 * min(points.total, rows * points.nb)
    modes = state + 16.0 * (n // 2 + 1) * columns
    transform = 8.0 * rows * n + 16.0 * rows * (n // 2 + 1) + 2.0 * spectral
    return Memory(3.0 * mine + modes, transform, state, transform + _map_bytes(scene.punch))


@dataclass(frozen=True)
class Effort:
    """Expected steps and transform pairs of a run, right within a factor of 3 where the material is viscoelastic.

    pair_seconds: of a pair in double precision. cost: of the run's pairs, relative to that.
    """

    steps: float
    pairs: float
    pair_seconds: float
    cost: float = 1.0

    @property
    def seconds(self) -> float:
        """Wall time on one rank of this machine."""
        return self.pairs * self.pair_seconds * (self.cost + OUTSIDE)


def modulus_of(scene) -> float:
    """E* [Pa] of a slow contact: static, but for a quasi-static run with the instantaneous modulus."""
    return scene.substrate.contact_modulus / quasistatic_compliance(scene)


def depth_of(scene, stiffening: float = 1.0) -> float:
    """Rough indentation [m] at the preload: static, or with a modulus that is larger by the factor `stiffening`."""
    punch, modulus, preload = scene.punch, stiffening * modulus_of(scene), scene.drive.preload
    if punch.radius is None:
        return 2.0 * (punch.amplitude or 0.0) + scene.adhesion.range
    if punch.pattern in ("sphere", "power"):
        return float(hertz.indentation(preload, punch.curvature_radius, modulus))
    image = 0.75 if scene.substrate.boundary == "periodic" else 1.0
    return image * preload / float(flat_punch.force(1.0, punch.radius, modulus))


def effort_of(scene) -> Effort:
    """Steps and transform pairs from a rule fitted to runs of the shipped scenes, n = 64 to 512.

    With adhesion, steps go like the travel in ranges, times sqrt(gamma/(E* v lambda)), lambda the longest
    retardation time, times accuracy^(-0.4); pairs a step hardly depend on the grid; elastic scenes jump at every
    instability and cost far more. Quasi-static runs: n = 64 to 256, accuracy 0.01 to 0.05; n = 32 and 48 with the
    instantaneous modulus. Without adhesion a few dozen steps are enough; fitted to elastic scenes, it is five times too
    much for a fast viscoelastic one.
    """
    if scene.solver.scheme == "gfmd":
        return _gfmd_effort(scene)
    adhesion, drive, modulus = scene.adhesion, scene.drive, modulus_of(scene)
    creep, quasistatic = relaxation_of(scene).to_creep(), scene.solver.scheme == "quasistatic"
    way = depth_of(scene)
    back = way
    if scene.punch.pattern == "flat":
        back += math.sqrt(2.0 * math.pi * adhesion.work_of_adhesion * scene.punch.radius / modulus)
    way += max(drive.clearance, 0.0)
    tightness = adhesion.work_of_adhesion / modulus
    refinement = (1e-2 / scene.solver.accuracy) ** 0.4
    if adhesion.law == "repulsive":
        steps = 30.0 * math.sqrt(refinement)
        return Effort(steps, steps * 24.0 * (scene.grid.n / 128) ** 0.6, pair_seconds(scene), pair_cost(scene))
    steps = pairs = 0.0
    for length, speed in ((way, drive.speed), (back, drive.retract_speed)):
        if creep.elements:
            longest = float(creep.retardation_times.max())
            rate, each = min(max(20.0 * math.sqrt(tightness / (speed * longest)), 2.0), 100.0), 7.5
        elif quasistatic:
            smooth = quasistatic_compliance(scene) <= SMOOTH
            rate, each = 110.0 * refinement, 7.5 if smooth else 19.0 * (scene.grid.n / 128) ** 0.4
            each *= refinement**0.4
        else:
            rate, each = 70.0, 25.0
        here = rate * length / adhesion.range * refinement
        steps += here
        pairs += here * each * refinement**-0.4
    return Effort(steps, pairs, pair_seconds(scene), pair_cost(scene))


def _gfmd_effort(scene) -> Effort:
    """One pair a step of known length; the time of the programme is that of the static depth, with what adhesion
    adds to the way back."""
    drive, depth = scene.drive, depth_of(scene)
    duration = (depth + max(drive.clearance, 0.0)) / drive.speed + drive.turn_time + drive.dwell
    duration += (depth + 2.0 * scene.adhesion.range) / drive.retract_speed
    steps = duration / inertia_of_scene(scene).step
    # All rows, where the fused transform has those under the punch.
    return Effort(steps, steps, 2.0 * pair_seconds(scene))


def pair_cost(scene) -> float:
    """Time of a run's transform pairs relative to pairs in double precision; in mixed precision nearly all are single."""
    return 1.0 if scene.solver.precision == "double" else SINGLE_PAIR


def pair_seconds(scene) -> float:
    """Rough time [s] of one transform pair in double precision on one core of this machine, from a few lines of it (scipy.fft).

    Half of that where half of the points are stepped, and a quarter where a quarter is: 0.44 to 0.63 and 0.23 to 0.39 were
    measured at n = 1024 and 2048.
    """
    # Not at the top: a run does not ask for it.
    import scipy.fft

    points = points_of(scene, expected(scene).mirror)
    nb = points.nb
    side = transform_side(scene, nb, mirror=points.mirror)
    width, lines = side // 2 + 1, max(4, min(64, 2**16 // side))
    real, columns = np.ones((lines, side)), np.ones((lines, side), complex)

    def seconds(action) -> float:
        action()
        times = []
        for _ in range(5):
            start = time.perf_counter()
            action()
            times.append(time.perf_counter() - start)
        return min(times)

    along_x = seconds(lambda: scipy.fft.irfft(scipy.fft.rfft(real), side))
    along_y = seconds(lambda: scipy.fft.ifft(scipy.fft.fft(columns)))
    return (nb * along_x + width * along_y) / lines / points.images
