"""Movies: which snapshots, the same colours in all frames, the marker on the curve, and files of either format."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image
from typer.testing import CliRunner

import pgfmd
from pgfmd.cli import app
from pgfmd.errors import ResultError
from pgfmd.plots import video_files
from pgfmd.plots.drawing import OCHRE
from pgfmd.plots.maps import FOUR_GREYS, OPEN
from pgfmd.plots.movie import chosen
from pgfmd.results import load
from pgfmd.results.curve import Loop
from tests.unit.synthetic_results import CONTACT_GAP, NEAR_GAP, OFFSET, write_results

SNAPSHOTS, NB = 7, 24


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_results(tmp_path_factory.mktemp("movie") / "out", rows=60, nb=NB, snapshots=SNAPSHOTS)


def same(colours, name):
    """Where an image has a colour."""
    wanted = np.round(255 * np.array(to_rgb(name))).astype(int)
    return (np.abs(colours[..., :3].astype(int) - wanted).max(axis=-1) == 0) & (colours[..., 3] > 0)


def test_frames_are_evenly_spaced_in_time_or_in_the_way_of_the_punch(folder):
    with load(folder) as results:
        loop, times = Loop.of(results), np.asarray(results.fields["time"])
        way = np.concatenate(([0], np.cumsum(np.abs(np.diff(loop.displacement)))))
        for even, places in (("time", times), ("displacement", np.interp(times, loop.time, way))):
            order = chosen(results, even, 41)
            assert order[0] == 0 and order[-1] == SNAPSHOTS - 1 and order == sorted(order)
            for moment, snapshot in zip(np.linspace(places[0], places[-1], 41), order, strict=True):
                assert abs(places[snapshot] - moment) == np.abs(places - moment).min()
        # After the third the punch rests, which a movie even in the way of the punch leaves out.
        assert chosen(results, "displacement", 41).count(2) < chosen(results, "time", 41).count(2)
        assert chosen(results, "time", 1) == [0]


def test_a_frame_shows_field_time_and_place_on_the_curve(folder):
    with load(folder) as results:
        for snapshot in (1, SNAPSHOTS - 2):
            figure = pgfmd.plot_frame(results, snapshot, "gap")
            force, position, time = (
                float(results.fields[key][snapshot]) for key in ("force", "punch_position", "time")
            )
            x, y = figure.axes[2].lines[-1].get_data()
            assert figure.axes[-1].get_xlabel() == "indentation (µm)"
            np.testing.assert_allclose((x[0], y[0]), (1e6 * (-position - OFFSET), 1e3 * force), rtol=1e-12)
            assert f"{time:.2f}" in figure.axes[0].get_title()
        image, gap = figure.axes[0].images[0].get_array(), results.frame("gap", SNAPSHOTS - 2)
        np.testing.assert_array_equal(same(image, OCHRE), gap < CONTACT_GAP)
        np.testing.assert_array_equal(image[..., 3] == 0, np.isnan(gap))
        bar = figure.axes[1]
        assert (
            bar.get_ylabel() == "gap (µm)" and "contact (gap < 180 nm)" in figure.legends[0].get_texts()[0].get_text()
        )
        image = pgfmd.plot_frame(results, 2, "contact").axes[0].images[0].get_array()
        gap = results.frame("gap", 2)
        for grey, low, high in zip(
            FOUR_GREYS, (-1, 0, CONTACT_GAP, NEAR_GAP), (0, CONTACT_GAP, NEAR_GAP, 1), strict=True
        ):
            np.testing.assert_array_equal(same(image, grey), (gap >= low) & (gap < high))


def test_all_frames_have_one_scale_and_open_is_told_from_zero(folder):
    with load(folder) as results:
        for field in ("gap", "traction", "displacement"):
            ends = {pgfmd.plot_frame(results, k, field).axes[1].get_ylim() for k in (0, SNAPSHOTS // 2)}
            assert len(ends) == 1
        given = pgfmd.plot_frame(results, 0, "displacement", limit=3e-6)
        np.testing.assert_allclose(given.axes[1].get_ylim(), (-3, 3))
        assert given.axes[1].get_ylabel().startswith("displacement of the surface (µm)")
        for snapshot in (0, SNAPSHOTS - 1):
            image = pgfmd.plot_frame(results, snapshot, "traction").axes[0].images[0].get_array()
            traction, gap = (results.frame(name, snapshot) for name in ("traction", "gap"))
            far = same(image, OPEN)
            assert not (far & ~(gap > 0)).any() and not far[np.abs(traction) > 10.0].any()
            assert far[np.abs(traction) < 1e-3].all()


def test_a_gif_has_all_frames_and_the_colours_of_the_field(folder, tmp_path):
    made = pgfmd.movie(folder, tmp_path / "m.gif", "contact", frames=10, rate=5)
    assert (made.frames, made.snapshots) == (10, SNAPSHOTS) and "7 snapshots for 10 frames" in made.remarks[0]
    with Image.open(made.path) as image:
        assert image.n_frames == SNAPSHOTS and image.size[0] > 600
        durations = []
        for k in range(image.n_frames):
            image.seek(k)
            durations.append(image.info["duration"])
        assert sum(durations) == 2000
        found = {colour for _, colour in image.convert("RGB").getcolors(2**20)}
    assert {(255, 255, 255), *(tuple(bytes.fromhex(grey[1:])) for grey in (FOUR_GREYS[0], FOUR_GREYS[3]))} <= found


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not there")
def test_an_mp4_shows_what_the_figure_shows(folder, tmp_path):
    made = pgfmd.movie(folder, tmp_path / "m.mp4", "traction", even="displacement", frames=5)
    command = ["ffmpeg", "-loglevel", "error", "-i", str(made.path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    content = subprocess.run(command, capture_output=True, check=True, timeout=60).stdout
    with pgfmd.load(folder) as results:
        last = pgfmd.plot_frame(results, SNAPSHOTS - 1, "traction")
    last.set_dpi(140)
    last.savefig(tmp_path / "last.png", dpi=140)
    wanted = np.asarray(Image.open(tmp_path / "last.png").convert("RGB")).astype(int)
    rows, columns = (size + size % 2 for size in wanted.shape[:2])
    frames = np.frombuffer(content, dtype=np.uint8).reshape(-1, rows, columns, 3)
    assert len(frames) == 5
    differences = np.abs(frames[-1, : wanted.shape[0], : wanted.shape[1]] - wanted).mean()
    assert differences < 2.0 and np.abs(frames[0].astype(int) - frames[-1]).mean() > 0.5
    assert [path.name for path in tmp_path.iterdir() if path.suffix != ".png"] == ["m.mp4"]


def test_without_ffmpeg_it_is_a_gif_and_says_so_and_a_failure_leaves_nothing(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(video_files, "find_ffmpeg", lambda: None)
    made = pgfmd.movie(folder, tmp_path / "m.mp4", frames=1)
    assert made.path == tmp_path / "m.gif" and "no ffmpeg here" in made.remarks[-1]
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho 'no such luck' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setattr(video_files, "find_ffmpeg", lambda: str(program))
    with pytest.raises(ResultError, match=r"n\.mp4: could not be written: .*no such luck"):
        pgfmd.movie(folder, tmp_path / "n.mp4", frames=1)
    with pytest.raises(ResultError, match=r"no folder .*nowhere"):
        pgfmd.movie(folder, tmp_path / "nowhere" / "m.gif", frames=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ffmpeg", "m.gif"]


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--out", "m.avi"], 2, "ends in .mp4 or .gif"),
        (["--field", "contact", "--limit", "2 um"], 2, "no scale"),
        (["--limit", "2 kPa"], 2, "length"),
        (["--out", "m.gif", "--frames", "3", "--field", "traction", "--limit", "20kPa"], 0, "m.gif"),
    ],
)
def test_command(folder, tmp_path, monkeypatch, options, code, said):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["movie", str(folder), *options], env={"COLUMNS": "200"})
    assert done.exit_code == code and said in re.sub(r"\s+", " ", done.output)
    assert (tmp_path / "m.gif").exists() == (code == 0)


def test_a_run_without_snapshots_is_refused(tmp_path):
    folder = write_results(tmp_path / "out", rows=20, fields=False)
    with pytest.raises(ResultError, match=r"no snapshots to be shown; output\.snapshots asks for them"):
        pgfmd.movie(folder, tmp_path / "m.gif")
    with pytest.raises(ValueError, match="expected one of contact, gap, traction, displacement"):
        pgfmd.movie(folder, tmp_path / "m.gif", field="stress")
