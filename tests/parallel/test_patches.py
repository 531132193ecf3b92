"""Contact patches on any number of ranks: as scipy labels the gathered field, and with the same bits."""

import math
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy import ndimage

import pgfmd.runner
from pgfmd.errors import Stopped
from pgfmd.physics.contact_sites import ContactSites, contact_sites
from pgfmd.physics.topography import Topography
from pgfmd.restart.sameness import differences
from pgfmd.results import load
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.patches import label_contact, patches_of
from pgfmd.solver.sites import SitePoints
from tests.stopper import StopAfter

pytestmark = pytest.mark.mpi

LENGTH = 1.0
CONTACT_GAP = 0.02
NO_SITES = ContactSites(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def spiral(n):
    """Two arms that wind around each other and cross every row many times."""
    position = np.arange(n) - 0.5 * (n - 1)
    r, angle = np.hypot(position[:, None], position), np.arctan2(position[:, None], position)
    return np.cos(angle - 1.2 * r) > 0.55


def comb(n):
    """Teeth that only the last row joins, beside ones that only the first row joins."""
    field = np.zeros((n, n), bool)
    field[:-2, ::4], field[2:, 2::4] = True, True
    field[0, : n // 2], field[-1, n // 2 :] = True, True
    return field


def rough(n, share, seed=1):
    values = np.random.default_rng(seed).random((n, n))
    return values < share


FIELDS = {
    "spiral": spiral, "comb": comb, "sparse": lambda n: rough(n, 0.2), "near percolation": lambda n: rough(n, 0.59),
    "dense": lambda n: rough(n, 0.8), "nothing": lambda n: np.zeros((n, n), bool),
    "everything": lambda n: np.ones((n, n), bool),
}  # fmt: skip


def slabs(n, size, empty):
    """(first, count) of each rank's rows of the cell; `empty`: all rows to the last rank, or the first ranks'."""
    if empty == "last":
        return [(0, n)] + [(n, 0)] * (size - 1)
    if empty == "first":
        return [(0, 0)] * (size - 1) + [(0, n)]
    return [None] * size


def points_of(n, radius, comm, empty="none"):
    return PunchPoints(Grid(n, LENGTH), radius, comm, slabs(n, comm.size, empty)[comm.rank])


def whole_of(points, vector):
    """The field of all ranks, one block on every rank."""
    return np.concatenate(points.comm.allgather(points.to_rows(vector, outside=-1.0)))


def expected_labels(inside, contact, periodic):
    """Labels from 0 in the order of first points, -1 elsewhere: by scipy on the whole field; by hand if periodic."""
    field = inside & contact
    labels = flooded(field) if periodic else ndimage.label(field)[0]
    found = np.full(field.shape, -1)
    found[field] = renamed(labels[field])
    return found


def flooded(field):
    """Patches of a periodic field by going from neighbour to neighbour."""
    n, labels = len(field), np.zeros(field.shape, int)
    for start in zip(*np.nonzero(field), strict=True):
        edge = [start] if not labels[start] else []
        while edge:
            i, j = edge.pop()
            if field[i, j] and not labels[i, j]:
                labels[i, j] = 1 + start[0] * n + start[1]
                edge += [((i + 1) % n, j), ((i - 1) % n, j), (i, (j + 1) % n), (i, (j - 1) % n)]
    return labels


def renamed(labels):
    """Labels by numbers from 0, in the order in which they come."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse]


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("name", FIELDS)
def test_labels_are_those_of_scipy_on_the_whole_field(name, periodic):
    comm, n = MPI.COMM_WORLD, 24
    field = FIELDS[name](n)
    for empty in ("none", "first", "last"):
        points = points_of(n, None if periodic else 0.48, comm, empty)
        mine = field[points.block_start :, points.block_start :][points.row_start :][: points.rows, : points.nb]
        labels = label_contact(points, mine[points.inside()], periodic)
        inside = np.concatenate(comm.allgather(points.inside()))
        block = slice(points.block_start, points.block_start + points.nb)
        expected = expected_labels(inside, field[block, block], periodic)
        np.testing.assert_array_equal(whole_of(points, labels.of_point), expected)
        assert labels.count == expected.max() + 1


def fields_for(points, seed=5):
    """A gap and a traction that do not depend on how the points are shared out."""
    rng = np.random.default_rng(seed)
    n = points.grid.n
    noise = ndimage.gaussian_filter(rng.standard_normal((2, n, n)), (0, 1.2, 1.2), mode="wrap")
    block = slice(points.block_start + points.row_start, points.block_start + points.row_start + points.rows)
    columns = slice(points.block_start, points.block_start + points.nb)
    return (values[block, columns][points.inside()] for values in noise)


@pytest.mark.parametrize("radius", [0.47, None])
def test_a_table_has_the_same_bits_on_any_number_of_ranks(radius):
    face = Topography("triangular", radius=radius or 0.5, wavelength=0.2, amplitude=0.01)
    sites, tables = contact_sites(face), []
    for comm, empty in ((MPI.COMM_SELF, "none"), (MPI.COMM_WORLD, "none"), (MPI.COMM_WORLD, "first")):
        points = points_of(45, radius, comm, empty)
        gap, traction = fields_for(points)
        tables.append(patches_of(points, gap, traction, SitePoints(points, sites), 0.0, radius is None))
    assert tables[0] == tables[1] == tables[2] and len(tables[0]) > 10
    assert {patch.kind for patch in tables[0]} >= {"", "merged", "saddle"}
    assert all(table == tables[0] for table in MPI.COMM_WORLD.allgather(tables[1]))


def test_sums_of_a_table_are_those_of_the_fields():
    comm = MPI.COMM_WORLD
    points = points_of(45, 0.47, comm)
    gap, traction = fields_for(points)
    table = patches_of(points, gap, traction, SitePoints(points, NO_SITES), CONTACT_GAP)
    whole = (whole_of(points, gap) < CONTACT_GAP) & np.concatenate(comm.allgather(points.inside()))
    pull = whole_of(points, traction)
    area = points.grid.cell_area
    labels, count = ndimage.label(whole)
    assert count == len(table)
    place = points.grid.coordinate(points.block_start + np.arange(points.nb))
    for patch in table:
        chosen = np.zeros(whole.shape, bool)
        chosen[whole] = renamed(labels[whole]) == patch.number
        assert patch.area == pytest.approx(chosen.sum() * area, rel=1e-14)
        assert patch.force == pytest.approx(-pull[chosen].sum() * area, rel=1e-12)
        y, x = np.nonzero(chosen)
        np.testing.assert_allclose([patch.x, patch.y], [place[x].mean(), place[y].mean()], atol=1e-14)
        assert (patch.kind, patch.nearest, patch.summits) == ("", "", 0)


# -- whole runs --------------------------------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path_factory):
    comm = MPI.COMM_WORLD
    yield Path(comm.bcast(str(tmp_path_factory.mktemp("patches")) if comm.rank == 0 else None))
    comm.Barrier()


RUNS = {
    "elastic, single": [
        "grid.n=20", "rheology.model=elastic", "solver.precision=single", "drive.preload=0.5 mN", "solver.accuracy=0.03",
    ],
    "gfmd": ["grid.n=20", "solver.scheme=gfmd", "drive.speed=1 mm/s", "drive.preload=0.2 mN", "output.every=20"],
}  # fmt: skip


def run(name, comm, folder):
    scene = load_scene("tri-tack", ['output.snapshots=["1.1 t_pl"]', *RUNS[name]])
    return run_scene(scene, comm, folder, lambda line: None, Options())


@pytest.mark.parametrize("name", RUNS)
def test_a_run_that_stops_keeps_the_same_sites_and_patches(name, folder, monkeypatch):
    comm = MPI.COMM_WORLD
    record = run(name, comm, folder / "whole")
    comm.Barrier()
    monkeypatch.setattr(pgfmd.runner, "StopSignals", StopAfter)
    monkeypatch.setattr(StopAfter, "steps", record["steps"] // 2 + 1)
    stops = 0
    while True:
        try:
            run(name, comm, folder / "linked")
            break
        except Stopped:
            stops += 1
    monkeypatch.setattr(StopAfter, "steps", math.inf)
    assert stops == 1
    found = comm.bcast(differences(folder / "whole", folder / "linked") if comm.rank == 0 else None)
    assert found == []
    if comm.rank == 0:
        with load(folder / "linked") as results:
            assert len(results.sites) > 20 and set(results.patches["snapshot"]) >= {0, 1}
        run(name, MPI.COMM_SELF, folder / "alone")
        for table in ("sites.csv", "patches.csv", "events.csv"):
            assert (folder / "alone" / table).read_bytes() == (folder / "whole" / table).read_bytes(), table
