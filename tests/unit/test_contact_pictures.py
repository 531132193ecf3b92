"""Maps and curves say what contact is: greys and legends by the run's own gaps, old folders by their old count."""

import math

import numpy as np
import pytest
from typer.testing import CliRunner

from pgfmd.cli import app
from pgfmd.plots import folder as plots
from pgfmd.plots.curves import plot_force
from pgfmd.plots.maps import FOUR_GREYS, GREYS, class_numbers, gap_classes, plot_contact_maps
from pgfmd.plots.sites import plot_sites
from pgfmd.results import load
from tests.unit.synthetic_results import CONTACT_GAP, NEAR_GAP, as_version_0_1, history, write_results

RANGE_HALF, NEAR = 264e-9, 500e-9


def lightness(grey):
    """L* of CIE 1976 of a grey of sRGB such as "#2b2b2b"."""
    part = int(grey[1:3], 16) / 255
    assert grey == f"#{grey[1:3] * 3}"
    light = part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
    return 116 * light ** (1 / 3) - 16 if light > 216 / 24389 else light * 24389 / 27


@pytest.mark.parametrize("greys", [GREYS, FOUR_GREYS])
def test_greys_are_told_apart_in_print(greys):
    steps = np.diff([*map(lightness, greys), 100.0])
    # Half a scale of ten from dark to white apart, and the lightest still seen on paper.
    assert steps[:-1].min() > 24.0 and steps[-1] > 4.0


@pytest.mark.parametrize(
    ("thresholds", "labels", "greys"),
    [
        ((RANGE_HALF, NEAR), ["overlap (gap < 0)", "contact (gap < 264 nm)", "near (gap < 500 nm)", "open"],
         FOUR_GREYS),
        ((RANGE_HALF, NEAR, False, 3), ["contact (gap < 264 nm)", "near (gap < 500 nm)", "open"], GREYS),
        ((0.0, NEAR), ["contact (gap < 0)", "near (gap < 500 nm)", "open"], GREYS),
        ((0.0, NEAR, True), ["overlap (gap < 0)", "near (gap < 500 nm)", "open"], GREYS),
        ((0.0, NEAR, True, 3), ["overlap (gap < 0)", "near (gap < 500 nm)", "open"], GREYS),
        # Thresholds by hand, of a run that counted overlap.
        ((RANGE_HALF, 0.0, True), ["overlap (gap < 0)", "contact (gap < 264 nm)", "open"],
         (*FOUR_GREYS[:2], FOUR_GREYS[3])),
        ((1.2e-6, NEAR), ["overlap (gap < 0)", "contact (gap < 1.2 µm)", "open"], (*FOUR_GREYS[:2], FOUR_GREYS[3])),
        ((NEAR, NEAR, False, 3), ["contact (gap < 500 nm)", "open"], (GREYS[0], GREYS[2])),
        ((0.0, 0.0), ["contact (gap < 0)", "open"], (GREYS[0], GREYS[2])),
    ],
)  # fmt: skip
def test_classes_that_nothing_can_be_in_are_left_out(thresholds, labels, greys):
    classes = gap_classes(*thresholds)
    assert [each.label for each in classes] == labels
    assert tuple(each.grey for each in classes) == tuple(greys)
    assert math.isinf(classes[-1].below)


def test_a_point_at_a_threshold_is_beyond_it():
    classes = gap_classes(RANGE_HALF, NEAR)
    gap = np.array([[-1e-9, 0.0, 1e-9], [RANGE_HALF, NEAR, np.nan]])
    np.testing.assert_array_equal(class_numbers(gap, classes), [[0, 1, 1], [2, 3, np.nan]])
    assert class_numbers(np.array([0.0]), gap_classes(0.0, 0.0)) == [1]


def drawn(folder, **options):
    """Legend, and for each map its numbers of classes, masked outside of the punch, and the greys it is drawn in."""
    with load(folder) as results:
        figure = plot_contact_maps(results, **options)
        gaps = [results.frame("gap", snapshot) for snapshot in range(len(results.labels))]
    images = [axis.images[0] for axis in figure.axes if axis.images]
    return [text.get_text() for text in figure.legends[0].texts], gaps, images


def test_maps_show_the_thresholds_of_the_run(tmp_path):
    folder = write_results(tmp_path / "out", rows=80, nb=96, snapshots=3)
    legend, gaps, images = drawn(folder)
    assert legend == ["overlap (gap < 0)", "contact (gap < 180 nm)", "near (gap < 400 nm)", "open"]
    assert (CONTACT_GAP, NEAR_GAP) == (180e-9, 400e-9)
    seen = set()
    for gap, image in zip(gaps, images, strict=True):
        found = image.get_array()
        np.testing.assert_array_equal(found.mask, np.isnan(gap))
        expected = 1 * (gap >= 0.0) + (gap >= CONTACT_GAP) + (gap >= NEAR_GAP)
        np.testing.assert_array_equal(found.compressed(), expected[~np.isnan(gap)])
        seen |= set(found.compressed())
        for number, grey in enumerate(FOUR_GREYS):
            assert image.cmap(image.norm(number))[0] == pytest.approx(int(grey[1:3], 16) / 255)
    assert seen == {0, 1, 2, 3}
    legend, gaps, images = drawn(folder, greys=3, near_gap=NEAR)
    assert legend == ["contact (gap < 180 nm)", "near (gap < 500 nm)", "open"]
    expected = 1 * (gaps[1] >= CONTACT_GAP) + (gaps[1] >= NEAR)
    np.testing.assert_array_equal(images[1].get_array().compressed(), expected[~np.isnan(gaps[1])])


def test_an_old_folder_is_named_by_what_it_counted(tmp_path):
    folder = as_version_0_1(write_results(tmp_path / "old", rows=80, nb=24, snapshots=2))
    with load(folder) as results:
        lower = plot_force(results).axes[1]
        assert {axis.get_ylabel() for axis in plot_sites(results).axes} == {"overlapping (gap < 0)"}
    assert lower.get_ylabel() == "overlap (mm²)"
    assert max(lower.lines[1].get_ydata()) == pytest.approx(1e6 * max(row.overlap_area for row in history(80)))
    assert drawn(folder)[0] == ["overlap (gap < 0)", "near (gap < 500 nm)", "open"]
    # Its snapshots hold the gaps: the contact of the law can be shown, by hand.
    assert drawn(folder, contact_gap=RANGE_HALF)[0][:2] == ["overlap (gap < 0)", "contact (gap < 264 nm)"]


def test_a_new_folder_is_named_by_contact(tmp_path):
    with load(write_results(tmp_path / "new", rows=80, fields=False)) as results:
        lower = plot_force(results).axes[1]
        assert {axis.get_ylabel() for axis in plot_sites(results).axes} == {"in contact"}
    assert lower.get_ylabel() == "contact (mm²)"
    assert max(lower.lines[1].get_ydata()) == pytest.approx(1e6 * max(row.contact_area for row in history(80)))


def test_options_of_the_command(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(plots, "plot_results", lambda *arguments: asked.append(arguments) or [])
    run, folder = CliRunner().invoke, str(write_results(tmp_path / "out", rows=20, fields=False))
    chosen = ["--greys", "3", "--contact-gap", "0.2um", "--gap", "range", "--format", "pdf", "--width", "double",
              "--stress-limit", "20 kPa"]  # fmt: skip
    for options in ([], ["--near-gap", "0 nm"], chosen):
        assert run(app, ["plot", folder, *options]).exit_code == 0
    assert [arguments[2:] for arguments in asked] == [
        (4, None, None, "png", None, None),
        (4, None, 0.0, "png", None, None),
        (3, pytest.approx(2e-7), "range", "pdf", "double", 2e4),
    ]
    for wrong in (["--greys", "5"], ["--contact-gap", "0.2"], ["--near-gap", "-1 nm"], ["--near-gap", "inf"],
                  ["--stress-limit", "0 Pa"], ["--format", "jpg"], ["--width", "3"], ["--log", "z"]):  # fmt: skip
        assert run(app, ["plot", folder, *wrong]).exit_code == 2, wrong
    assert len(asked) == 3
