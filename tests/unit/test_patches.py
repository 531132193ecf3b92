"""Contact patches and their sites on one rank: what a table says of shapes that can be counted by hand."""

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import PATCHES, SITES
from pgfmd.output.patch_observer import ContactWatch, PatchTable
from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.contact_sites import ContactSites, contact_sites
from pgfmd.physics.topography import Topography
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.patches import patches_of
from pgfmd.solver.simulation import Event
from pgfmd.solver.sites import SitePoints

N = 20
POINTS = PunchPoints(Grid(N, 1.0), None, MPI.COMM_SELF)
LAW = Cosine(work_of_adhesion=1.0, range=1.0)


def sites(*places):
    """Sites by (x, y, kind)."""
    x, y, kind = (np.array(column, float) for column in zip(*places, strict=True)) if places else (np.zeros(0),) * 3
    return ContactSites(x, y, np.zeros(x.size), kind.astype(np.int64))


def table(field, traction=None, places=(), periodic=False):
    # Held under tension: in contact, though nothing overlaps.
    gap = np.where(field, 0.9 * LAW.contact_gap, 1.1 * LAW.contact_gap).ravel()
    traction = np.zeros(gap.size) if traction is None else traction.ravel()
    return patches_of(POINTS, gap, traction, SitePoints(POINTS, sites(*places)), LAW.contact_gap, periodic)


def test_corners_do_not_connect_and_sides_do():
    field = np.zeros((N, N), bool)
    field[2, 2] = field[3, 3] = field[3, 4] = True
    assert [patch.area for patch in table(field)] == pytest.approx([1 / N**2, 2 / N**2])


def test_force_is_compressive_positive_and_of_the_patch_alone():
    field, traction = np.zeros((N, N), bool), np.full((N, N), 7.0)
    field[1, 1:4], field[8:10, 5] = True, True
    traction[1, 1:4], traction[8, 5] = (-1.0, -2.0, -3.0), 5.0
    first, second = table(field, traction)
    assert (first.force * N**2, second.force * N**2) == pytest.approx((6.0, -12.0))
    assert (first.number, second.number) == (0, 1)


def test_centre_and_order_by_the_first_point():
    field = np.zeros((N, N), bool)
    field[0, 19], field[2:5, 1:4] = True, True
    corner, square = table(field)
    assert (corner.x, corner.y) == pytest.approx((0.475, -0.475))
    assert (square.x, square.y) == pytest.approx((-0.375, -0.325))


def test_a_patch_goes_on_across_the_edges_of_a_periodic_cell():
    field = np.zeros((N, N), bool)
    field[:2, 9:11] = field[-2:, 9:11] = True
    field[9:11, :1] = field[9:11, -3:] = True
    assert len(table(field)) == 4
    across_y, across_x = table(field, periodic=True)
    assert (across_y.area, across_x.area) == pytest.approx((8 / N**2, 8 / N**2))
    assert (across_y.x, abs(across_y.y)) == pytest.approx((0.0, 0.5))
    assert (across_x.x, across_x.y) == pytest.approx((0.45, 0.0))


def test_kinds_of_patches():
    field = np.zeros((N, N), bool)
    field[2:4, 2:4] = field[2:4, 10:14] = field[15, 15] = field[15, 2] = True
    at = POINTS.grid.coordinate(np.arange(N))
    places = [(at[2], at[3], 0), (at[10], at[2], 0), (at[13], at[3], 1), (at[15], at[15], 1), (at[5], at[18], 2)]
    found = table(field, places=places)
    assert [patch.kind for patch in found] == ["summit", "merged", "", "saddle"]
    held = [(patch.summits, patch.saddles, patch.valleys) for patch in found]
    assert held == [(1, 0, 0), (1, 1, 0), (0, 0, 0), (0, 1, 0)]
    assert [patch.nearest for patch in found][2:] == ["valley", "saddle"]
    assert [patch.nearest for patch in table(field)] == [""] * 4


def test_sites_stand_on_the_nearest_point_under_the_punch_and_mirror_each_other():
    points = PunchPoints(Grid(32, 1.5e-3), 375e-6, MPI.COMM_SELF)
    face = contact_sites(Topography("triangular", 375e-6, wavelength=150e-6, amplitude=4e-6))
    places = SitePoints(points, face)
    x, y = points.coordinates()
    away = np.hypot(x[places.index] - face.x, y[places.index] - face.y)
    every = np.hypot(x - face.x[:, None], y - face.y[:, None]).min(axis=1)
    np.testing.assert_allclose(away, every, atol=1e-5 * points.grid.spacing)
    assert away.max() < 1.5 * points.grid.spacing
    # At x = 0 both points beside the axis are as near.
    beside = np.abs(face.x) > 1e-9
    held = {
        (round(1e12 * a), round(1e12 * b))
        for a, b in zip(*(axis[places.index][beside] for axis in (x, y)), strict=True)
    }
    assert held == {(-x, y) for x, y in held}


# -- following sites ---------------------------------------------------------------------------------------------------


class Still:
    """A simulation whose surface is set by hand; the sites' points are in contact where it is within half a range of the punch."""

    def __init__(self):
        self.height = np.ones(POINTS.size)
        self.scheme, self.state, self.phase, self.phases, self.stepped = self, self, self, [self], 0
        self.law, self.name, self.position, self.punch_position, self.time, self.force = (
            LAW,
            "approach",
            0.0,
            0.0,
            0.0,
            0.0,
        )
        self.surface_displacement, self.traction = np.zeros(POINTS.size), np.zeros(POINTS.size)


def watch_of(folder, run):
    at = POINTS.grid.coordinate(np.arange(N))
    places = SitePoints(POINTS, sites((at[1], at[0], 0), (at[2], at[0], 1), (at[3], at[0], 1)))
    return ContactWatch(TableFile(SITES, folder / "sites.csv", MPI.COMM_SELF), POINTS, places, jumps=True), places


def test_rows_come_when_sites_join_and_leave(tmp_path):
    run = Still()
    watch, _ = watch_of(tmp_path, run)
    for time, kind, contact in ((0.0, "start", [1]), (1.0, "step", [1, 2, 3]), (2.0, "time", []), (3.0, "jump", [2])):
        run.time, run.force, run.surface_displacement = time, 10 * time, run.surface_displacement.copy()
        run.surface_displacement[0:6] = 0.0
        run.surface_displacement[contact] = 0.6
        run.traction = np.zeros(POINTS.size)
        run.traction[[1, 7]] = 3.0, -2.0 * time
        if kind == "time":
            run.surface_displacement[contact] = 0.0
        watch.observe(run, Event(kind))
    lines = [line.split(",") for line in (tmp_path / "sites.csv").read_text().splitlines()]
    assert tuple(lines[0]) == SITES.titles
    assert [(row[0], row[2], row[4], row[5], *row[8:]) for row in lines[1:]] == [
        ("0.0", "0.0", "summit", "0", "joins", "1", "1"),
        ("1.0", "10.0", "saddle", "1", "joins", "1", "2"), ("1.0", "10.0", "saddle", "2", "joins", "2", "2"),
        ("3.0", "30.0", "summit", "0", "leaves", "0", "1"), ("3.0", "30.0", "saddle", "2", "leaves", "1", "2"),
    ]  # fmt: skip
    change = watch.change
    assert (change.joined, change.left, change.at) == ("", "1 summit; 1 saddle", "saddle 2")
    # From 1 s to 3 s, by 4 Pa at point 7 alone.
    assert (change.x, change.y) == pytest.approx((POINTS.grid.coordinate(7), POINTS.grid.coordinate(0)))


def test_what_was_in_contact_before_a_restart_joins_no_second_time(tmp_path):
    run = Still()
    run.surface_displacement[[1, 3]] = 0.6
    watch, _ = watch_of(tmp_path, run)
    watch.before_step(run)
    run.surface_displacement[[1, 2, 3]] = 0.4, 0.6, 1.5
    watch.observe(run, Event("step"))
    rows = [line.split(",") for line in (tmp_path / "sites.csv").read_text().splitlines()[1:]]
    assert [(row[5], row[8], row[9]) for row in rows] == [("0", "leaves", "0"), ("1", "joins", "2")]


def test_a_face_without_sites_writes_no_rows(tmp_path):
    run = Still()
    file = TableFile(SITES, tmp_path / "sites.csv", MPI.COMM_SELF)
    watch = ContactWatch(file, POINTS, SitePoints(POINTS, sites()), jumps=False)
    watch.observe(run, Event("start"))
    run.surface_displacement[:] = 2.0
    watch.observe(run, Event("jump"))
    assert file.rows == 0 and watch.change.joined == watch.change.at == "" and np.isnan(watch.change.x)


def test_a_frame_gives_the_patches_of_its_own_surface(tmp_path):
    file = TableFile(PATCHES, tmp_path / "patches.csv", MPI.COMM_SELF)
    write = PatchTable(file, POINTS, SitePoints(POINTS, sites()), LAW.contact_gap, periodic=False)
    gap = np.ones((N, N))
    gap[4, 4] = gap[7, 7] = 0.3
    write(3, 2.5, gap.ravel(), np.full(N * N, -4.0))
    write(4, 3.5, np.ones(N * N), np.zeros(N * N))
    rows = (tmp_path / "patches.csv").read_text().splitlines()[1:]
    assert [row.split(",")[:5] for row in rows] == [
        ["3", "2.5", str(k), repr(POINTS.grid.cell_area), repr(4.0 * POINTS.grid.cell_area)] for k in (0, 1)
    ]
