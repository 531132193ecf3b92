"""What a scene will cost: memory from the arrays that a run allocates, and the time of a pair of transforms; how many it
will take is in effort.py. No MPI; nothing large is allocated."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pgfmd import coarsening
from pgfmd.parts import quasistatic_compliance, topography_of, transform_side
from pgfmd.physics.heightfile import map_bytes
from pgfmd.physics.random_surface import surface_bytes
from pgfmd.reference import flat_punch, hertz
from pgfmd.schemes import registry
from pgfmd.solver.grid import PunchPoints
from pgfmd.symmetry import expected, points_of

if TYPE_CHECKING:
    from pgfmd.scene import Scene
    from pgfmd.scene.model import Punch

OWN_BYTES = 110e6
"""Private memory of each rank for Python, compiled kernels and libraries (scripts/studies/cost/memory.py at n = 64)."""
FILE_BYTES = 138e6
"""Memory of the program's files, which the ranks of a node share (measured likewise)."""
PROGRAM_BYTES = OWN_BYTES + FILE_BYTES
"""Memory of a single rank in addition to its fields."""
FUSED_PAIR = 0.55
"""Time of a transform pair in double precision, relative to `pair_seconds`."""
OUTSIDE = 0.2
"""Time of all other work of a run per pair, relative to `pair_seconds`."""
SINGLE_PAIR = 0.63
"""Time of a transform pair in single precision, relative to one in double: 0.54 to 0.75 for n = 192 to 2048."""
CALLS = 2.5e-4
"""What else a pair takes [s], however small the grid: the calls of its parts."""
CELLS = 1.0 / 3.0
"""Time that a coarser grid takes for each pair on all points, relative to `pair_seconds`."""


@dataclass(frozen=True)
class Memory:
    """Bytes of one rank's arrays.

    points: vectors over the punch, of which `state` belong to the State. transform: its arrays. start: the most at any
    time before the first step, what stays included. output: what is held for snapshots, and while one is written.
    """

    points: float
    transform: float
    state: float
    start: float
    output: float = 0.0

    @property
    def running(self) -> float:
        """While steps are made."""
        return self.points + self.transform

    @property
    def peak(self) -> float:
        """The most at any time."""
        return max(self.running + self.output, self.start)

    def in_all(self, ranks: int) -> float:
        """The most of all ranks of a node together, with the program."""
        return ranks * (self.peak + OWN_BYTES) + FILE_BYTES


def punch_points(scene: Scene) -> PunchPoints:
    """The points under the punch as a single rank would own them, all of them."""
    return points_of(scene, "")


def largest_share(points: PunchPoints, ranks: int) -> int:
    """Points of the rank that has most of them: under a round punch, the rows in the middle are longer."""
    ends = [sum(rows) for rows in points.shares_among(ranks)]
    return int(np.diff(points.offset[ends], prepend=0).max())


def memory_of(scene: Scene, ranks: int = 1) -> Memory:
    """Memory of the rank with the largest share, out of `ranks`."""
    return registry.scheme_of(scene).memory_of(scene, ranks)


def rough_share(scene: Scene) -> float:
    """Size of the numbers within conjugate gradients, relative to that of those which last."""
    return 0.5 if scene.solver.precision == "mixed" else 1.0


def memory_of_vectors(scene: Scene, ranks: int, counts: tuple[float, float]) -> Memory:
    """Memory of a scheme that solves static problems (newton.py), of the rank with the largest share.

    counts: numbers that a run keeps for every point under the punch, (state, everything else).

    Transform: G0, (columns, n/2 + 1), and the half-transformed columns, complex, (nb, columns), where the ranks share
    memory; messages between nodes take about as much again. The weights of the far field are made beside it by another transform, without G0, and
    the kernel of a free surface is held by rows, and with more than one rank by columns, of (n/2 + 1, n/2 + 1).
    """
    points = points_of(scene, expected(scene).mirror)
    rows, columns, width, multiplier = _transform_of(scene, points, ranks)
    periodic = scene.substrate.boundary == "periodic"
    precision = scene.solver.precision
    size, rough = 4.0 if precision == "single" else 8.0, rough_share(scene)
    # With patches, the traction before each step: jumps are placed by it.
    counts = counts[0], counts[1] + scene.output.patches
    most = largest_share(points, ranks)
    state, rest = (size * most * count for count in counts)
    halves = 2.0 * rows * columns
    transform = (multiplier + halves) * (size + (4.0 if precision == "mixed" else 0.0)) + _cells_bytes(
        scene, size * rough
    )
    heights = map_bytes_of(scene.punch)
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
    return Memory(state + rest, transform, state, start, output_bytes(scene, points, ranks, size))


def _cells_bytes(scene: Scene, size: float) -> float:
    """The coarser grid of a run (two_grid.py), which each rank has whole. size: of a number [bytes]."""
    coarse = coarsening.scene_of_cells(scene)
    if coarse is None:
        return 0.0
    points = points_of(coarse, expected(scene).mirror)
    rows, columns, _, multiplier = _transform_of(coarse, points, 1)
    return size * (multiplier + 2.0 * rows * columns + 7.0 * largest_share(points, 1))


def output_bytes(scene: Scene, points: PunchPoints, ranks: int, size: float) -> float:
    """The surface and traction of the largest tension, and what a snapshot needs for a while: one field of the whole punch as a
    vector and as rows of the block; and with patches gap and traction of the whole punch, labels of points, and of the block."""
    whole, here = points.whole, largest_share(points, ranks)
    most, block = largest_share(whole, ranks), whole.nb * math.ceil(whole.nb / ranks)
    writing = 8.0 * (most + block)
    finding = 24.0 * most + 5.0 * block if scene.output.patches else 0.0
    return (2.0 + scene.output.surface) * size * here + max(writing, finding)


def _transform_of(scene: Scene, points: PunchPoints, ranks: int) -> tuple[int, int, int, float]:
    """Rows of all ranks; complex columns of one of them, out of `ranks`; numbers that a column of G0 has, and all of its
    columns."""
    width = transform_side(scene, points.nb, mirror=points.mirror) // 2 + 1
    columns = math.ceil((width // 2 if points.mirror else width) / ranks)
    # Of mirror images, a complex column is two real ones.
    return points.nb - points.top, columns, width, float(columns * width * (2 if points.mirror else 1))


def map_bytes_of(punch: Punch) -> float:
    """A height map, or the waves of a random face, while heights are taken from it."""
    if punch.pattern == "rough":
        return surface_bytes(punch.period, punch.shortest)
    return map_bytes(punch.file, topography_of(punch).file_order) if punch.file else 0.0


def modulus_of(scene: Scene) -> float:
    """E* [Pa] of a slow contact: static, but for a quasi-static run with the instantaneous modulus."""
    return scene.substrate.contact_modulus / quasistatic_compliance(scene)


def depth_of(scene: Scene, stiffening: float = 1.0) -> float:
    """Rough indentation [m] at the preload: static, or with a modulus that is larger by the factor `stiffening`."""
    punch, modulus, preload = scene.punch, stiffening * modulus_of(scene), scene.drive.preload
    if punch.radius is None:
        return 2.0 * (punch.amplitude or 0.0) + scene.adhesion.range
    if punch.pattern in ("sphere", "power"):
        return float(hertz.indentation(preload, punch.curvature_radius, modulus))
    image = 0.75 if scene.substrate.boundary == "periodic" else 1.0
    return image * preload / float(flat_punch.force(1.0, punch.radius, modulus))


def pair_cost(scene: Scene) -> float:
    """Time of a run for each of its transform pairs, relative to `pair_seconds`; in mixed precision nearly all are single.
    With what a coarser grid takes for each."""
    cells = CELLS if coarsening.expected(scene).factor else 0.0
    return OUTSIDE + cells + FUSED_PAIR * (1.0 if scene.solver.precision == "double" else SINGLE_PAIR)


def guessed_seconds(pairs: float, seconds: float, cost: float) -> float:
    """Wall time [s] of so many pairs on one rank of this machine, a rough guess. seconds: `pair_seconds`; cost: `pair_cost`."""
    return pairs * (seconds * cost + CALLS)


def pair_seconds(scene: Scene) -> float:
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

    def seconds(action: Callable[[], object]) -> float:
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
