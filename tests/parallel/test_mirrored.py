"""Punches that are their own mirror images, on a half or a quarter of their points: the whole punch all the same."""

import csv
import math
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.fft
from mpi4py import MPI

from pgfmd.assemble import assemble, mirror_of
from pgfmd.physics.contact_sites import ContactSites
from pgfmd.physics.film import Film
from pgfmd.physics.free_kernel import FreeHalfSpace
from pgfmd.physics.halfspace import HalfSpace
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
from pgfmd.solver.far_field import far_weights
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.mirrored_transform import MirroredConvolution
from pgfmd.solver.multiplier import free_multiplier, periodic_multiplier
from pgfmd.solver.sites import SitePoints
from pgfmd.solver.transform import Convolution

pytestmark = pytest.mark.mpi

LENGTH = 1.5e-3
# Grid points, and the radius as a share of the cell: powers of two and not, odd halves and quarters, whole cells, blocks
# of two rows, more ranks than pairs of rows.
CELLS = [(4, 0.25), (10, 0.2), (64, 0.25), (72, 0.25), (90, 0.25), (100, 0.23), (100, 0.5), (14, None), (16, None)]
PERIODIC = {"prestrained": HalfSpace(2.65e6, (1.3, 0.7)), "film": Film(2e6, 0.49, 0.2e-3, "bonded")}


def gathered(comm, values):
    return np.concatenate(comm.allgather(np.asarray(values)))


def local(points, seed=5):
    """The local part of a random point vector that doesn't depend on the number of ranks."""
    whole = np.random.default_rng(seed).standard_normal(points.total // points.images)
    return whole[points.first_point : points.first_point + points.size]


def points_of(n, share, comm, mirror=""):
    return PunchPoints(Grid(n, LENGTH), None if share is None else share * LENGTH, comm, mirror=mirror)


def operators(points, kind, dtype=np.float64):
    """The convolution on these points, and that on all of them, on one rank."""
    whole = points_of(points.grid.n, points.radius and points.radius / LENGTH, MPI.COMM_SELF)
    sides = [points.grid.n] * 2
    if kind == "free":
        make = free_multiplier(FreeHalfSpace(2.65e6, (1.2, 0.8)), points.grid.spacing)
        sides = [2 * scipy.fft.next_fast_len(points.nb), scipy.fft.next_fast_len(2 * points.nb - 1, real=True)]
    else:
        make = periodic_multiplier(PERIODIC[kind], LENGTH)
    return MirroredConvolution(points, sides[0], make, dtype=dtype), Convolution(whole, sides[1], make), whole


@pytest.mark.parametrize("kind", [*PERIODIC, "free"])
@pytest.mark.parametrize("mirror", ["x", "xy"])
@pytest.mark.parametrize(("n", "share"), CELLS)
def test_a_part_is_convolved_as_the_whole_and_with_the_same_bits_on_any_number_of_ranks(n, share, mirror, kind):
    comm = MPI.COMM_WORLD
    points, alone = (points_of(n, share, each, mirror) for each in (comm, MPI.COMM_SELF))
    part, everything, whole = operators(points, kind)
    found = part(local(points), points.zeros(), 0.37)
    expected = everything(alone.unfold(local(alone)), whole.zeros(), 0.37)
    error = np.abs(gathered(comm, points.unfold(found)) - expected).max()
    assert error <= 1e-15 * np.abs(expected).max()
    own = operators(alone, kind)[0](local(alone), alone.zeros(), 0.37)
    np.testing.assert_array_equal(gathered(comm, found), own)
    # Of a free surface it is that of the transform, whose size is another.
    assert kind == "free" or part.mean_compliance == pytest.approx(everything.mean_compliance, rel=1e-12)


@pytest.mark.parametrize("mirror", ["x", "xy"])
def test_single_precision_is_as_good_as_single_precision_is(mirror):
    comm = MPI.COMM_WORLD
    # Rows of a quarter that have no partner, and displacements a billion times smaller than tractions.
    points, alone = (points_of(100, 0.23, each, mirror) for each in (comm, MPI.COMM_SELF))
    assert mirror == "x" or (points.nb - points.top) % 2
    part, everything, whole = operators(points, "film", np.float32)
    for seed in range(2):
        found = part(local(points, seed).astype(np.float32), points.zeros(np.float32))
        expected = everything(alone.unfold(local(alone, seed)), whole.zeros())
        np.testing.assert_allclose(
            gathered(comm, points.unfold(found)), expected, atol=5e-7 * np.abs(expected).max(), rtol=0
        )  # fmt: skip


@pytest.mark.parametrize("mirror", ["x", "xy"])
@pytest.mark.parametrize(("n", "share"), CELLS)
def test_points_and_their_images_are_the_whole_punch(n, share, mirror):
    comm = MPI.COMM_WORLD
    points, whole = points_of(n, share, comm, mirror), points_of(n, share, comm)
    assert points.total == whole.total == comm.allreduce(points.size) * points.images
    x, y = points.coordinates()
    assert (x > 0.0).all() and (mirror == "x" or (y > 0.0).all())
    x, y = (points.unfold(place) for place in (x, y))
    for found, expected, axis in ((x, whole.coordinates()[0], "x"), (y, whole.coordinates()[1], "y")):
        np.testing.assert_array_equal(found, np.abs(expected) if axis in mirror else expected)
    # Sums over a part are those over all.
    ones = np.diff(points.offset).astype(float)[np.newaxis]
    assert points.total_of(ones)[0] == whole.total


@pytest.mark.parametrize("mirror", ["x", "xy"])
def test_weights_of_the_far_field_are_symmetric(mirror):
    comm, substrate = MPI.COMM_WORLD, PERIODIC["film"]
    points, whole = points_of(72, 0.25, comm, mirror), points_of(72, 0.25, comm)
    weights = far_weights(substrate, whole)
    found = points.unfold(far_weights(substrate, points))
    largest = points.maximum_of(float(np.abs(weights).max(initial=0.0)))
    np.testing.assert_allclose(found, weights, atol=1e-13 * largest, rtol=0)


@pytest.mark.parametrize("mirror", ["x", "xy"])
def test_sites_have_the_images_of_their_points(mirror):
    comm = MPI.COMM_WORLD
    points, whole = points_of(64, 0.25, comm, mirror), points_of(64, 0.25, comm)
    # Under the punch, anywhere, on the axes, half-way between points, and on points.
    at = np.random.default_rng(2).uniform(-0.25, 0.25, 40) * LENGTH
    at = np.concatenate([at, whole.grid.coordinate(np.arange(24, 39.1, 0.5))])
    x, y = (part.ravel() for part in np.meshgrid(at, at[::3]))
    x, y = (part[np.hypot(x, y) <= points.radius] for part in (x, y))
    sites = ContactSites(x, y, 0.0 * x, np.zeros(x.size, np.int64))
    part, everything = SitePoints(points, sites), SitePoints(whole, sites)
    number = points.first_point + np.arange(points.size)
    found = part.collect(number[part.local])
    np.testing.assert_array_equal(found, everything.collect(points.unfold(number)[everything.local]))
    assert len(set(found)) > 100 / points.images


RUNS = {
    "triangular": ("x", ["tri-tack", "grid.n=48", "drive.preload=5 mN", "output.surface=true"]),
    "hexagonal, free, five elements": (
        "x",
        ["hex-tack", "grid.n=50", "substrate.boundary=free", "drive.preload=2 mN", "rheology.model=geometric",
         "rheology.relaxation_time=40 us", "rheology.elements=5", "rheology.time_ratio=6", "rheology.exponent=0.8",
         "drive.speed=20 um/s", "output.surface=true"],
    ),
    "flat film": ("xy", ["flat-punch", "grid.n=36", "substrate.thickness=0.4 mm", "output.surface=true"]),
    "sphere": (
        "xy",
        ["hertz", "grid.n=40", "rheology.model=single", "rheology.modulus_ratio=100", "rheology.relaxation_time=1 ms",
         "adhesion.law=cosine", "drive.speed=20 um/s", "drive.preload=1 mN"],
    ),
}  # fmt: skip


def columns(path):
    """The columns of a table as arrays, those of words left out."""
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    found = {}
    for name in rows[0] if rows else ():
        try:
            found[name] = np.array([float(row[name]) for row in rows])
        except ValueError:
            continue
    return found


@pytest.mark.parametrize("name", RUNS)
def test_a_run_on_a_part_writes_what_a_run_on_the_whole_writes(name, tmp_path_factory):
    """To 1e-3 of the tolerance: these take the same steps, and differ by rounding."""
    comm, (mirror, (source, *changes)) = MPI.COMM_WORLD, RUNS[name]
    folder = Path(comm.bcast(str(tmp_path_factory.mktemp("runs")) if comm.rank == 0 else None))
    record = run_scene(load_scene(source, changes), comm, folder / "part", lambda line: None)
    whole = run_scene(load_scene(source, [*changes, "solver.symmetry=none"]), comm, folder / "whole", lambda line: None)
    assert (record["mirror"], whole["mirror"]) == (mirror, "")
    if comm.size > 1:
        run_scene(load_scene(source, changes), MPI.COMM_SELF, folder / f"alone {comm.rank}", lambda line: None)
        assert not differences(folder / "part", folder / f"alone {comm.rank}")
        comm.Barrier()
    for table in ("curve.csv", "energy.csv", "patches.csv", "sites.csv"):
        here, there = (columns(folder / run / table) for run in ("part", "whole"))
        assert here.keys() == there.keys()
        for column, values in there.items():
            scale = np.abs(values).max() if column != "residual" else np.abs(there["work"]).max()
            np.testing.assert_allclose(here[column], values, atol=1e-5 * scale, rtol=0, err_msg=f"{table}: {column}")
    with h5py.File(folder / "part" / "fields.h5") as here, h5py.File(folder / "whole" / "fields.h5") as there:
        assert here.keys() == there.keys()
        for field in ("gap", "traction", "displacement", "surface_displacement"):
            if field in there:
                found, expected = here[field][()], there[field][()]
                np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
                largest = np.nanmax(np.abs(expected))
                np.testing.assert_allclose(np.nan_to_num(found), np.nan_to_num(expected), atol=1e-5 * largest, rtol=0)
                if field != "surface_displacement":
                    np.testing.assert_array_equal(found, found[:, :, ::-1])
    comm.Barrier()


def test_a_jump_is_placed_where_the_whole_punch_would_place_it(tmp_path_factory):
    """Of mirror images the first one, in the order of the whole punch's points."""
    comm = MPI.COMM_WORLD
    folder = Path(comm.bcast(str(tmp_path_factory.mktemp("jumps")) if comm.rank == 0 else None))
    for symmetry in ("auto", "none"):
        scene = load_scene("flat-punch", ["grid.n=32", "rheology.modulus_ratio=8", f"solver.symmetry={symmetry}"])
        record = run_scene(scene, comm, folder / symmetry, lambda line: None)
        assert record["jumps"] == 1
    if comm.rank == 0:
        here, there = ((folder / run / "events.csv").read_text().splitlines() for run in ("auto", "none"))
        assert len(here) == len(there) and ",jump," in here[1]
        keys = there[0].split(",")
        for one, other in zip(here[1:], there[1:], strict=True):
            one, other = (dict(zip(keys, line.split(","), strict=True)) for line in (one, other))
            assert all(one[key] == other[key] for key in ("event", "joined", "left", "at"))
            for key in ("x [m]", "y [m]"):
                assert float(one[key]) == float(other[key]) or math.isnan(float(one[key]))
    comm.Barrier()


def test_one_rank_that_sees_a_difference_is_enough(monkeypatch):
    comm, scene = MPI.COMM_WORLD, load_scene("flat-punch", ["grid.n=24"])
    assert mirror_of(scene, comm) == "xy"
    last = comm.rank == comm.size - 1
    monkeypatch.setattr("pgfmd.symmetry.has_images", lambda topography, points: not (last and points.mirror == "xy"))
    assert mirror_of(scene, comm) == "x"
    assert assemble(scene, comm).points.mirror == "x"
