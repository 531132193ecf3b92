"""From a scene to a simulation: the nouns of scene_objects.py put on a grid that is shared out over the ranks."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from . import coarsening, scene_objects, symmetry
from .errors import Problem, SceneError
from .host.launch import on_first
from .map_rules import refusals
from .maps.raw import MapError
from .physics import heightfile
from .physics.adhesion.registry import law_of
from .schemes import registry
from .solver.conjugate_gradients import ConjugateGradients
from .solver.far_field import far_weights
from .solver.grid import PunchPoints
from .solver.mirrored_transform import MirroredConvolution
from .solver.multiplier import FEW, free_multiplier, periodic_multiplier
from .solver.newton import NewtonSolver
from .solver.simulation import Simulation
from .solver.transform import Convolution

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from numpy.typing import DTypeLike

    from .scene import Scene
    from .solver.newton import MakeCorrections
    from .solver.tiles import Convolves

STEP_SHARE = 0.7
"""Tolerance of a step's error, in ranges of adhesion, for a `solver.accuracy` of 1. With 0.5,
tri-tack at n = 512 takes 9 % more transforms at the default accuracy, and its audit closes to 0.4 instead of 0.55 %."""


def tolerance_of(scene: Scene) -> float:
    """Tolerance of a step's error, in ranges of adhesion or as a share of the largest force."""
    return STEP_SHARE * scene.solver.accuracy


def convolution_of(
    scene: Scene, points: PunchPoints, whole_cell: bool = False, dtype: DTypeLike = np.float64
) -> Convolution | MirroredConvolution:  # fmt: skip
    """The operator G0 on the scene's grid, or a coarser one; `whole_cell`: fit for `Convolution.whole_cell` too; dtype: its precision."""
    if scene.substrate.boundary == "periodic":
        # The cell's, or that of a coarser grid.
        make, side = periodic_multiplier(scene_objects.compliance_of(scene), scene.grid.length), points.grid.n
    else:
        make = free_multiplier(scene_objects.free_compliance_of(scene), points.grid.spacing)
        side = scene_objects.transform_side(scene, points.nb, whole_cell, points.mirror)
    kind = MirroredConvolution if points.mirror else Convolution
    return kind(points, side, make, dtype=dtype)


def heights_of(scene: Scene, points: PunchPoints) -> np.ndarray:
    """Height z [m] of the punch's lower face at the local points, its minimum over all ranks zero."""
    topography, heights = scene_objects.topography_of(scene.punch), points.zeros()
    # A few points at a time: formulas need many arrays.
    for start in range(0, points.size, FEW):
        heights[start : start + FEW] = topography.heights(*points.coordinates(start, start + FEW))
    heights += points.maximum_of(-heights.min() if heights.size else -math.inf)
    return heights


def mirror_of(scene: Scene, comm: Intracomm) -> str:
    """The axes along which a scene is its own mirror image, where its run makes use of that; the same on every rank.
    Collective."""

    def holds(axes: str) -> bool:
        points = symmetry.points_of(scene, axes, comm)
        return not points.maximum_of(float(not symmetry.has_images(scene_objects.topography_of(scene.punch), points)))

    return "" if symmetry.obstacle(scene) else symmetry.largest(holds)


def share_map(scene: Scene, comm: Intracomm) -> None:
    """Has rank 0 read the map of a scene for all of them; a large one on the disk each maps into memory itself. Collective.

    Raises SceneError on every rank for a map that is not to be run as it is.
    """
    if scene.punch.pattern != "file":
        return
    face = scene_objects.topography_of(scene.punch)

    def read() -> tuple[heightfile.HeightMap, heightfile.Stamp] | None:
        try:
            problems = list(refusals(face, scene.grid.length / scene.grid.n))
        except MapError as error:
            problems = error.problems
        except (ValueError, OSError) as error:
            problems = [Problem("punch.file", scene.punch.file, "a usable topography", str(error))]
        if problems:
            raise SceneError(scene.title or "the scene", problems)
        return None if face.map.on_disk else heightfile.kept(face.map_request)

    found = on_first(comm, read)
    if found is not None and comm.rank > 0:
        heightfile.remember(face.map_request, *found)


def assemble(scene: Scene, comm: Intracomm, mirror: str | None = None) -> Simulation:
    """A simulation of the scene on a communicator, without observers. Collective.

    mirror: the axes whose mirror images are not stepped, those of the run that is to go on; found out by default.
    """
    share_map(scene, comm)
    mirror = mirror_of(scene, comm) if mirror is None else mirror
    scheme, controller = registry.scheme_of(scene).new(scene, comm, mirror)
    drive = scene_objects.drive_of(scene)
    return Simulation(scheme, controller, drive, scene_objects.deepest_indentation(scene), scene.solver.max_steps)


def newton_solver(
    scene: Scene, comm: Intracomm, mirror: str, wrap: Callable[[Convolves], Convolves] = lambda convolve: convolve
) -> NewtonSolver:
    """The static contact problem of the scene; wrap: what is made of its convolutions."""
    points = symmetry.points_of(scene, mirror, comm)
    dtype = np.dtype(np.float32 if scene.solver.precision == "single" else np.float64)
    convolve = wrap(convolution_of(scene, points, dtype=dtype))
    rough = wrap(convolution_of(scene, points, dtype=np.float32)) if scene.solver.precision == "mixed" else None
    height = heights_of(scene, points).astype(dtype, copy=False)
    corrections: MakeCorrections = ConjugateGradients
    m = coarsening.expected(scene).factor
    if m:
        corrections = _corrections_on_two_grids(scene, points, m, (rough or convolve).dtype, wrap)
    return NewtonSolver(points, convolve, height, law_of(scene.adhesion), scene.drive.preload, rough, corrections)


def _corrections_on_two_grids(
    scene: Scene, points: PunchPoints, m: int, dtype: DTypeLike, wrap: Callable[[Convolves], Convolves]
) -> MakeCorrections:
    """The solver for corrections with a coarse grid of cells of m x m points. Each rank has the whole coarse grid."""
    # Not at the top: small scenes do without.
    from .solver.two_grid import CoarseGrid, TwoGrid, coarse_points_of

    comm = points.comm
    if comm.size > 1:
        from mpi4py import MPI

        comm = MPI.COMM_SELF
    coarse = coarse_points_of(points, m, comm)
    # As of a periodic cell: a free solid answers to short waves like that.
    waves = scene_objects.compliance_of(scene)
    shortest = np.pi / coarse.grid.spacing * np.eye(2)
    operator = wrap(convolution_of(scene, coarse, dtype=dtype))
    return partial(TwoGrid, coarse=CoarseGrid(coarse, operator, float(waves(*shortest).max())))


def far_weights_of(scene: Scene, solver: NewtonSolver) -> np.ndarray:
    """Weights of the far displacement, none without a periodic cell."""
    periodic = scene.substrate.boundary == "periodic"
    weights = far_weights(scene_objects.compliance_of(scene), solver.points) if periodic else np.zeros(0)
    return weights.astype(solver.dtype, copy=False)
