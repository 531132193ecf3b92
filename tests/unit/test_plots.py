"""Pictures: the right data in the right units, every kind of results folder, nothing left behind in matplotlib."""

import re
import sys
import warnings

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread

from pgfmd.errors import ResultError
from pgfmd.files.tables import CURVE
from pgfmd.plots import folder as plots
from pgfmd.plots import maps as map_plots
from pgfmd.plots.curves import plot_curve, plot_energy, plot_force, plot_time
from pgfmd.plots.drawing import WIDTHS, drawing, energy_unit
from pgfmd.plots.sites import plot_sites
from pgfmd.results import load
from pgfmd.results.curve import Loop, measure
from pgfmd.results.sites import site_histories
from tests.unit.synthetic_results import CONTACT_GAP, NEAR_GAP, PUNCH, history, sphere, write_results


def names(pages: int = 1) -> list[str]:
    """Of the pictures of a folder that has data for all."""
    maps = [
        f"{kind}{f'-{page}' if page > 1 else ''}"
        for kind in ("contact-maps", "stress-maps")
        for page in range(1, pages + 1)
    ]
    return [f"{name}.png" for name in ("force-displacement", "time", *maps, "energy", "sites")]


@pytest.fixture(autouse=True)
def warnings_are_errors():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.mark.parametrize(("snapshots", "nb", "missing"), [(1, 33, ("pandas", "xarray")), (13, 16, ())])
def test_every_picture_is_written_and_not_blank(tmp_path, monkeypatch, snapshots, nb, missing):
    for library in missing:
        monkeypatch.setitem(sys.modules, library, None)
    folder = write_results(tmp_path / "out", rows=80, nb=nb, snapshots=snapshots)
    left = [folder / f"contact-maps-{page}.png" for page in (2, 3, 4)]
    for path in left:
        path.touch()
    paths = plots.plot_results(folder)
    # Pages of an earlier plot of more snapshots.
    assert [path in paths for path in left] == [path.exists() for path in left]
    assert [path.name for path in paths] == names(-(-snapshots // 12))
    for path in paths:
        picture = imread(path)
        assert picture.shape[0] > 300 and picture.shape[1] > 500
        assert picture[..., :3].std() > 0.03


def test_only_what_the_folder_has_data_for(tmp_path):
    folder = write_results(tmp_path / "out", rows=80, energy=False, fields=False, contact=False)
    assert [path.name for path in plots.plot_results(folder)] == names()[:2]


def settings():
    return matplotlib.rcParams.copy(), matplotlib.get_backend(auto_select=False), "matplotlib.pyplot" in sys.modules


def test_empty_curve_and_foreign_folder(tmp_path):
    with pytest.raises(ResultError, match="not a results folder"):
        plots.plot_results(tmp_path)
    (tmp_path / "curve.csv").write_text(",".join(CURVE.titles) + "\n")
    with pytest.raises(ResultError, match="has no rows"):
        plots.plot_results(tmp_path)


def test_picture_that_can_not_be_written(tmp_path):
    folder = write_results(tmp_path / "out", rows=40, fields=False)
    (folder / "energy.png").mkdir()
    with pytest.raises(ResultError, match=r"energy\.png: is a folder, not a file; move it away"):
        plots.plot_results(folder)


def test_curves_are_in_mN_um_and_mm2_with_landmarks(tmp_path):
    rows = history(200)
    with load(write_results(tmp_path / "out", rows=200, fields=False)) as results:
        upper, lower, _ = plot_force(results).axes
        found = measure(Loop.of(results))
    lines = {line.get_label(): line for line in upper.lines}
    first_out = next(k for k, row in enumerate(rows) if row.phase == "retract")
    out = lines["retraction"]
    np.testing.assert_allclose(out.get_xdata(), [1e6 * row.indentation for row in rows[first_out - 1 :]], rtol=1e-14)
    np.testing.assert_allclose(out.get_ydata(), [1e3 * row.force for row in rows[first_out - 1 :]], rtol=1e-14)
    assert lines["approach"].get_xdata().size == first_out
    assert lines["approach"].is_dashed() and not out.is_dashed()
    areas = [1e6 * row.contact_area for row in rows[first_out - 1 :]]
    np.testing.assert_allclose(lower.lines[1].get_ydata(), areas, rtol=1e-14)
    marked = {label.split("  ")[0]: line.get_ydata().item() for label, line in lines.items() if "  " in label}
    last_in = next(k for k, row in enumerate(rows) if row.phase != "approach") - 1
    np.testing.assert_allclose(marked["preload"], 1e3 * rows[last_in].force, rtol=1e-14)
    # The parabola through rows may lie a little lower than these: at a sudden snap, by a few percent.
    for name, part, dip in (("pull-off", rows, found.pull_off), ("snap-in", rows[:80], found.snap_in)):
        assert marked[name] == -1e3 * dip.tension
        assert 1e3 * min(row.force for row in part) == pytest.approx(marked[name], abs=1e3 * dip.tension / 10)


def test_sites_are_counted_along_the_curve(tmp_path):
    rows = history(200)
    with load(write_results(tmp_path / "out", rows=200, fields=False)) as results:
        sites, (found,) = results.sites, site_histories(results, Loop.of(results))
        upper, lower = plot_sites(results).axes
    touched = np.array([row.contact_area > 0 for row in rows])
    joins, leaves = (sites["time [s]"][k] for k in range(2))
    # Each row of the curve once, and each change before and after it.
    assert (found.kind, found.of, found.count.size) == ("summit", 1, 200 + 4)
    for time, counts in ((joins, [0, 1, 1]), (leaves, [1, 0, 0])):
        assert list(found.count[found.time == time]) == counts
    steady, rest = (~np.isin(times, (joins, leaves)) for times in (found.time, [row.time for row in rows]))
    np.testing.assert_array_equal(found.count[steady], touched[rest])
    way_in, way_out = upper.lines[:2]
    assert way_in.is_dashed() and way_out.get_label() == "summits, of 1"
    assert way_in.get_xdata()[-1] == way_out.get_xdata()[0] and way_out.get_ydata()[-1] == 0
    np.testing.assert_allclose(lower.lines[0].get_xdata()[0], 1e6 * rows[0].indentation, rtol=1e-12)


def images(figure) -> list:
    return [axis.images[0] for axis in figure.axes if axis.images]


def test_contact_map_has_its_levels_in_place(tmp_path):
    with load(write_results(tmp_path / "out", rows=80, nb=48, snapshots=6)) as results:
        figure = map_plots.plot_contact_maps(results)
        shown = images(figure)
        assert len(shown) == 6
        inside, gap, _, _ = sphere(48, np.sqrt(history(80)[int(0.292 * 79)].contact_area / np.pi))
        expected = 1 * (gap >= 0.0) + (gap >= CONTACT_GAP) + (gap >= NEAR_GAP)
        array = shown[1].get_array()
        np.testing.assert_array_equal(array.mask, ~inside)
        np.testing.assert_array_equal(array[inside], expected[inside])
        assert set(np.unique(array[inside])) == {0, 1, 2, 3}
    np.testing.assert_allclose(shown[1].get_extent(), 1e6 * PUNCH * np.array([-1, 1, -1, 1]), rtol=1e-12)


def test_stress_map_is_symmetric_in_kPa_and_y_points_up(tmp_path):
    with load(write_results(tmp_path / "out", rows=80, nb=48, snapshots=6)) as results:
        figure = map_plots.plot_stress_maps(results)
        traction = results.frame("traction", 1)
    shown = images(figure)
    limits = {image.get_clim() for image in shown}
    assert len(limits) == 1 and limits.pop()[0] == -shown[0].get_clim()[1]
    assert shown[1].origin == "lower"
    np.testing.assert_allclose(shown[1].get_array().filled(np.nan), traction / 1e3, rtol=1e-14)
    assert figure.axes[-1].get_ylabel() == "normal traction (kPa), tension > 0"


def test_fine_grids_are_thinned_out_but_keep_their_size(tmp_path, monkeypatch):
    monkeypatch.setattr(map_plots, "MOST_PIXELS", 20)
    with load(write_results(tmp_path / "out", rows=80, nb=48, snapshots=1)) as results:
        shown = images(map_plots.plot_stress_maps(results))[0]
    assert shown.get_array().shape == (16, 16)
    np.testing.assert_allclose(shown.get_extent(), 1e6 * PUNCH * np.array([-1, 1, -1, 1]), rtol=1e-12)


def test_colour_limit_is_not_set_by_one_point_or_by_empty_snapshots():
    field = np.full((100, 100), 1e5)
    field[0, 0] = -1e9
    assert map_plots.robust_limit([field]) == (1e9, False)  # all others below 1 % of it
    field[0, 0] = -5e6
    limit, clipped = map_plots.robust_limit([field, np.zeros((1000, 1000)), np.full((5, 5), np.nan)])
    assert limit == 1e5 and clipped
    assert map_plots.robust_limit([np.zeros((3, 3))]) == (1.0, False)


@pytest.mark.parametrize("snapshots", [2, 7])
def test_panels_do_not_overlap(tmp_path, snapshots):
    with load(write_results(tmp_path / "out", rows=80, nb=16, snapshots=snapshots)) as results, drawing():
        for make in (map_plots.plot_contact_maps, map_plots.plot_stress_maps, plot_force, plot_energy):
            figure = make(results)
            figure.draw_without_rendering()
            boxes = [axis.get_tightbbox() for axis in figure.axes]
            pairs = [(one, other) for k, one in enumerate(boxes) for other in boxes[:k]]
            assert not any(one.shrunk(0.98, 0.98).overlaps(other) for one, other in pairs)
            assert all(box.x0 >= 0 and box.x1 <= figure.bbox.x1 for box in boxes)
            assert all(box.y0 >= 0 and box.y1 <= figure.bbox.y1 for box in boxes)


def test_every_snapshot_is_on_one_page(tmp_path):
    folder = write_results(tmp_path / "out", rows=80, nb=8, snapshots=25)
    pages = map_plots.pages_of(folder)
    assert [k for page in pages for k in page] == list(range(25)) and [len(page) for page in pages] == [9, 8, 8]
    assert len(images(map_plots.plot_stress_maps(folder, page=3))) >= 8
    with pytest.raises(ResultError, match="has 3 pages of maps, so no page 4"):
        map_plots.plot_contact_maps(folder, page=4)


@pytest.mark.parametrize(("largest", "bar"), [(225.0, 200.0), (200.0, 200.0), (199.0, 100.0), (0.07, 0.05)])
def test_scale_bar_is_a_round_length(largest, bar):
    assert map_plots.round_length(largest) == pytest.approx(bar, rel=1e-12)


@pytest.mark.parametrize(("size", "unit"), [(2.0, "J"), (3e-8, "nJ"), (1e-9, "nJ"), (9e-13, "fJ"), (0.0, "fJ")])
def test_energy_unit(size, unit):
    assert energy_unit(size)[1] == unit


def test_a_small_tension_has_a_panel_of_its_own(tmp_path):
    with load(write_results(tmp_path / "out", rows=200, fields=False)) as results:
        curve = results.curve
        figure = plot_force(results)
        close, lowest = figure.axes[2], 1e3 * curve["force [N]"].min()
        with drawing("single"):
            narrow = plot_force(results)
            narrow.draw_without_rendering()
        # Ten times as much tension is no small one.
        curve["force [N]"] = curve["force [N]"].where(curve["force [N]"] > 0.0, 10.0 * curve["force [N]"])
        assert len(plot_force(results).axes) == 2
    assert close.get_ylim() == pytest.approx((1.2 * lowest, -2.0 * lowest)) and close.get_title() == "tension"
    np.testing.assert_array_equal(close.lines[1].get_ydata(), figure.axes[0].lines[1].get_ydata())
    assert narrow.get_figwidth() == 3.5 and narrow.axes[2].get_position().y1 < narrow.axes[1].get_position().y0


def test_runs_share_a_picture_and_its_foot_says_what_they_are(tmp_path):
    folders = [write_results(tmp_path / name / "run", rows=60, fields=False) for name in ("one", "two")]
    (folders[0] / "scene.resolved.toml").write_text(
        'title = "Test of $5"\n[drive]\nspeed = "1e-06 m/s"\nretract_speed = "2.5e-05 m/s"\n[grid]\nn = 192\n'
    )
    figure = plot_force(*folders)
    names = [text.get_text() for text in figure.axes[0].get_legend().texts]
    assert names.pop() == "approach" and names == ["one/run", "two/run"]
    looks = {
        (line.get_color(), str(line.get_linestyle())) for line in figure.axes[0].lines if line.get_label() in names
    }
    assert len(looks) == 2
    (foot,) = figure.texts
    assert foot.get_text().startswith("2 runs; the first: Test of \\$5  ·  1 µm/s in, 25 µm/s out  ·  n = 192  ·  ")
    (alone,) = plot_time(folders[1]).texts
    assert alone.get_text().startswith("run  ·  ")


def test_force_and_indentation_against_time_with_jumps(tmp_path):
    rows = history(200)
    upper, lower = plot_time(write_results(tmp_path / "out", rows=200, fields=False)).axes
    np.testing.assert_allclose(upper.lines[0].get_xydata(), [(row.time, 1e3 * row.force) for row in rows], rtol=1e-14)
    np.testing.assert_allclose(lower.lines[0].get_ydata(), [1e6 * row.indentation for row in rows], rtol=1e-14)
    jumps = next(line for line in upper.lines if line.get_label() == "jumps").get_xdata()
    assert len(jumps) == 1 and rows[100].time < jumps[0] < rows[-1].time


def test_any_column_against_any_other(tmp_path):
    folder, rows = write_results(tmp_path / "out", rows=100, fields=False), history(100)
    axis = plot_curve(folder, x="time", y="contact").axes[0]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("time (s)", "contact area (mm²)")
    drawn = np.concatenate([line.get_ydata() for line in axis.lines])
    assert drawn.max() == pytest.approx(1e6 * max(row.contact_area for row in rows))
    axis = plot_curve(folder, x="force", y="viscous", log="xy").axes[0]
    assert (axis.get_xscale(), axis.get_yscale(), axis.get_ylabel()) == ("log", "log", "viscous energy (nJ)")
    with pytest.raises(ValueError, match="'forc': expected one of time, displacement"):
        plot_curve(folder, x="forc")
    with pytest.raises(ResultError, match="its u_inf is nowhere above zero"):
        plot_curve(folder, y="u_inf", log="y")
    (folder / "energy.csv").unlink()
    with pytest.raises(ResultError, match="no viscous for every row"):
        plot_curve(folder, y="viscous")


def test_no_traction_is_told_from_one_that_is_zero(tmp_path):
    folder = write_results(tmp_path / "out", rows=80, nb=48, snapshots=2)
    with load(folder) as results:
        figure, gap, traction = (
            map_plots.plot_stress_maps(results),
            results.frame("gap", 0),
            results.frame("traction", 0),
        )
        limit = map_plots.stress_limit(results)
        given = map_plots.plot_stress_maps(results, limit=5e4)
    inside = np.isfinite(gap)
    shown = figure.axes[0].images
    is_open = ~np.ma.getmaskarray(shown[1].get_array())
    np.testing.assert_array_equal(is_open, inside & (gap > 0.0) & (np.abs(traction) <= 1e-6 * limit))
    assert is_open.any() and not is_open.all() and figure.legends[0].texts[0].get_text() == "open, no traction"
    assert given.axes[0].images[0].get_clim() == (-50.0, 50.0)


def test_maps_by_the_range_of_adhesion(tmp_path):
    folder = write_results(tmp_path / "out", rows=80, nb=24, snapshots=2)
    with pytest.raises(ResultError, match="tells no range of adhesion"):
        map_plots.plot_contact_maps(folder, near_gap="range")
    with open(folder / "scene.resolved.toml", "a") as file:
        file.write('[adhesion]\nrange = "1.2e-06 m"\n')
    legend = map_plots.plot_contact_maps(folder, near_gap="range").legends[0].texts
    assert [text.get_text() for text in legend][2] == "near (gap < 1.2 µm)"


@pytest.mark.parametrize("width", ["single", "double"])
def test_widths_of_journals_leave_the_settings_of_the_caller_alone(tmp_path, width):
    folder, before = write_results(tmp_path / "out", rows=60, nb=16, snapshots=1), settings()
    paths = plots.plot_results(folder, tmp_path / width, form="svg", width=width)
    assert len(paths) == 6 and settings() == before
    for path in paths:
        points = re.search(r'width="([\d.]+)pt"', path.read_text())[1]
        assert float(points) == pytest.approx(72 * WIDTHS[width])
