"""Reports: what a page says is what the folder says, everything is in the one file, and a browser shows it without a fault."""

import base64
import csv
import io
import json
import re
import shutil
import zipfile

import numpy as np
import pytest
from PIL import Image

import pgfmd
from pgfmd.errors import ResultError
from pgfmd.reporting import maps, run_page
from pgfmd.reporting.page import MOST_BYTES, Downloads
from pgfmd.reporting.report import report
from pgfmd.reporting.wording import entry, of_scene
from pgfmd.results import load
from pgfmd.results.curve import Loop
from tests.unit.chromium import Browser, executable
from tests.unit.synthetic_results import PUNCH, as_version_0_1, write_results

HOSTILE = "</script><script>alert('1')</script> & <b>"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A finished run whose title is hostile."""
    folder = write_results(tmp_path_factory.mktemp("report") / "a run & more", rows=120, nb=48, snapshots=3)
    path = folder / "scene.resolved.toml"
    path.write_text(f"title = {json.dumps(HOSTILE)}\n{path.read_text()}")
    return folder


@pytest.fixture(scope="module")
def page(folder):
    return report(folder).read_text(encoding="utf-8")


def data_of(page):
    """What the scripts of a page are given."""
    return json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.S)[1])


def files_of(page):
    """The files in a page, by name."""
    found = re.findall(r'download="([^"]+)" href="data:[^,]*;base64,([^"]+)"', page)
    return {name: base64.b64decode(text) for name, text in found}


def test_what_comes_from_a_users_files_is_text(page, folder):
    assert page.count("<script") == 2 and "<b>" not in page and "alert(" in page
    assert f"<h1>{HOSTILE.translate({60: '&lt;', 62: '&gt;', 38: '&amp;', 39: '&#39;'})}</h1>" in page
    # Nor does a label of a snapshot, or a name of a folder, end the script's data.
    assert "<" not in re.search(r'application/json">(.*?)</script>', page, re.S)[1]
    assert len(page.encode()) < MOST_BYTES and not re.search(r"""(src|href)=["']?(?!data:)\w""", page)


def test_its_curves_are_the_runs(page, folder):
    data = data_of(page)
    with load(folder) as results:
        loop = Loop.of(results)
        energy = results.energy
    force = next(chart for chart in data["charts"] if chart["key"] == "force")
    assert force["x"] == "indentation (µm)" and force["y"] == "force (mN)"
    approach, retraction = force["series"]
    rows = loop.branches["retraction"]
    assert np.allclose(retraction["x"], 1e6 * loop.indentation[rows], rtol=1e-5)
    assert np.allclose(retraction["y"], 1e3 * loop.force[rows], rtol=1e-5) and approach["line"] != retraction["line"]
    audit = next(chart for chart in data["charts"] if chart["key"] == "energy")
    assert [one["name"] for one in audit["series"]][-1] == "residual"
    assert max(audit["series"][0]["y"]) == pytest.approx(1e9 * energy["work [J]"].max(), rel=1e-5)
    pull_off = next(mark for mark in force["marks"] if mark["text"] == "pull-off")
    assert pull_off["y"] == pytest.approx(1e3 * loop.force.min(), rel=1e-2)


def test_its_files_are_the_folders(page, folder):
    found = files_of(page)
    assert set(found) == {path.name for path in folder.iterdir() if path.suffix in (".csv", ".toml", ".json")}
    for name, content in found.items():
        assert content == (folder / name).read_bytes()


def test_long_tables_are_thinned_and_said_to_be(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(run_page, "MOST_READ", 5000)
    monkeypatch.setattr(run_page, "THINNED_ROWS", 30)
    page = report(folder, out=tmp_path / "r.html").read_text(encoding="utf-8")
    thin = files_of(page)["curve.thinned.csv"].decode().splitlines()
    whole = (folder / "curve.csv").read_text().splitlines()
    assert "curve.csv" not in files_of(page) and "curve.csv has 120 rows" in page
    assert thin[0] == whole[0] and thin[-1] == whole[-1] and 25 < len(thin) < 35 and set(thin) < set(whole)
    full = Downloads()
    full.add("noise.csv", np.random.default_rng(1).bytes(2_000_000))
    assert full.left_out == ["noise.csv.gz (2 MB)"] and not full.files


def test_maps_are_the_snapshots(page, folder):
    slides = data_of(page)["slides"]
    assert [kind["name"] for kind in slides["kinds"]] == ["contact", "gap", "traction"]
    with load(folder) as results:
        gap, count = results.frame("gap", 1), len(results.labels)
        level, near = results.contact_gap, results.near_gap
    assert len(slides["frames"]) == count
    frame = slides["frames"][1]
    image = Image.open(io.BytesIO(base64.b64decode(frame["images"][0].partition(",")[2])))
    shades = np.asarray(image.convert("RGBA"))
    classes = np.where(np.isnan(gap), -1, np.searchsorted([0.0, level, near], gap, side="right"))[::-1]
    for number, shown in enumerate(slides["kinds"][0]["legend"]):
        colour = [int(shown["colour"][k : k + 2], 16) for k in (1, 3, 5)]
        there = (shades[..., :3] == colour).all(axis=-1) & (shades[..., 3] == 255)
        assert np.array_equal(there, classes == number) and there.any(), shown
    assert np.array_equal(shades[..., 3] == 0, classes == -1)
    assert frame["bar"]["share"] * 2 * PUNCH == pytest.approx(2e-4)


def test_blocks_have_thecommonest_class_and_the_mean():
    numbers = np.array([[0, 1, 2], [1, 1, 2], [np.nan, np.nan, 0]])
    # The last block has one point, the others in it are beyond the edge.
    assert maps.commonest(numbers, 2, 3).tolist() == [[1, 2], [maps.OUTSIDE, maps.OUTSIDE]]
    means = maps._means(np.array([[1.0, 2.0], [3.0, np.nan]]), 2)
    assert means.tolist() == [[2.0]]
    assert np.isnan(maps._means(np.array([[1.0, np.nan], [np.nan, np.nan]]), 2)).all()
    assert maps.evenly(100, 5) == [0, 25, 50, 74, 99] and maps.evenly(3, 5) == [0, 1, 2]


def test_maps_get_smaller_until_they_fit(folder, monkeypatch):
    monkeypatch.setattr(maps, "SIDES", (48, 24, 12))
    with load(folder) as results:
        large = maps.slides(maps.frames_of(results), {})
        size = sum(len(image) for frame in large.data["frames"] for image in frame["images"])
        monkeypatch.setattr(maps, "MOST_BYTES", size - 1)
        small = maps.slides(maps.frames_of(results), {}, total=9)
    assert large.note == "" and small.data["frames"][0]["pixels"] < 48
    assert "snapshots up to 48 points" in small.note and "3 of 9 snapshots" in small.note


def test_folders_of_all_kinds_give_a_page(folder, tmp_path):
    old = as_version_0_1(shutil.copytree(folder, tmp_path / "old"))
    page = report(old).read_text(encoding="utf-8")
    assert "version 0.1 of pgfmd made this run" in page and "overlap area" in page
    live = shutil.copytree(folder, tmp_path / "live")
    (live / "run.json").unlink()
    (live / "fields.h5").unlink()
    with open(live / "curve.csv", "a") as file:
        file.write("1.0,2.0")
    page = report(live).read_text(encoding="utf-8")
    assert "the loop is not closed" in page and "has written no snapshots" in page and "net work so far" in page
    rows = (folder / "curve.csv").read_text().splitlines(keepends=True)
    (live / "curve.csv").write_text("".join(rows[:20]))
    assert "the approach is not over" in report(live).read_text(encoding="utf-8")
    (live / "curve.csv").write_text(rows[0])
    page = report(live).read_text(encoding="utf-8")
    assert "the numbers can&#39;t be shown" in page and "has no rows" in page and not data_of(page)["charts"]
    (live / "energy.csv").write_text("nothing\n")
    (live / "curve.csv").write_bytes((folder / "curve.csv").read_bytes())
    assert "energy.csv" in report(live).read_text(encoding="utf-8")
    with pytest.raises(ResultError, match="no such folder"):
        report(tmp_path / "nothing")


@pytest.fixture(scope="module")
def study(folder, tmp_path_factory):
    """A study of which a case has failed, one can't be read, and one was never begun."""
    study = tmp_path_factory.mktemp("studies") / "speeds"
    for number, speed in enumerate((1e-6, 2e-6, 4e-6)):
        case = shutil.copytree(folder, study / f"speed-{number}")
        (case / "report.html").unlink(missing_ok=True)
        (case / "scene.resolved.toml").write_text(
            f'title = "Speeds"\n[drive]\nspeed = "{speed!r} m/s"\npreload = "0.1 N"\n[grid]\nn = 192\n'
        )
    broken = study / "speed-2"
    record = json.loads((broken / "run.json").read_text()) | {"finished": "failed", "error": "no <equilibrium>"}
    (broken / "run.json").write_text(json.dumps(record))
    shutil.copytree(study / "speed-0", study / "unreadable")
    (study / "unreadable" / "curve.csv").write_text("a,b\n1,2\n")
    (study / "table.csv").write_text(
        "case,drive.speed [m/s],state\nspeed-0,1e-6,finished\nlater,2,new\n../../x,2,new\n"
    )
    return study


def test_a_study_says_how_its_cases_stand(study):
    page = report(study).read_text(encoding="utf-8")
    data, files = data_of(page), files_of(page)
    rows = list(csv.reader(io.StringIO(files["cases.csv"].decode())))
    assert [row[0] for row in rows] == ["case", "speed-0", "later", "speed-1", "speed-2", "unreadable"]
    states = {row[0]: row[-1] for row in rows}
    assert states["speed-0"].startswith("finished") and states["later"] == "new"
    assert "no &lt;equilibrium&gt;" in page and "unreadable: " in page and "../../x" not in "".join(states)
    numbers = next(chart for chart in data["charts"] if chart["key"] == "number-pull-off")
    assert numbers["x"] == "speed (µm/s)" and numbers["series"][0]["x"] == [1.0, 2.0, 4.0]
    assert len(data["slides"]["frames"]) == 3
    with zipfile.ZipFile(io.BytesIO(files["cases.zip"])) as archive:
        name = "speed-1/scene.resolved.toml"
        assert archive.read(name) == (study / name).read_bytes()
    with pytest.raises(ResultError, match="a twin is one of a run"):
        report(study, twin=study / "speed-0")


def test_a_measured_curve_is_laid_over(folder, study, tmp_path):
    with load(folder) as results:
        loop = Loop.of(results)
    path = tmp_path / "exp.csv"
    # The made-up loop gives energy, which no measured one may.
    share = np.where(np.arange(len(loop.force)) > loop.turning_row, 0.8, 1.1)
    rows = zip(1e6 * loop.indentation, 1e3 * share * loop.force, strict=True)
    path.write_text("displacement (um),force (mN)\n" + "".join(f"{x:.6f},{y:.6f}\n" for x, y in rows))
    for source in (folder, study):
        page = report(source, measured=path, out=tmp_path / "m.html", baseline=0.0).read_text(encoding="utf-8")
        force = data_of(page)["charts"][0]
        dots = [one for one in force["series"] if one["line"] == "dots"]
        assert max(max(one["y"]) for one in dots) == pytest.approx(1.1e3 * loop.force.max(), rel=1e-4)
        assert "What was done to the curves" in page
    page = report(folder, measured=path, out=tmp_path / "m.html", baseline=0.0, offset=1e-3).read_text(encoding="utf-8")
    assert "exp has no indentation in common with a run &amp; more" in page


def test_numbers_have_the_digits_of_their_uncertainty():
    told = entry("", 1.41408e-3, "N", "", 2.83e-5)
    assert (told.value, told.unit) == ("1.414 ± 0.028", "mN")
    assert entry("", -2.6e-9, "J", "", 1.5e-10).value == "\N{MINUS SIGN}2.60 ± 0.15"
    assert entry("", None, "N").value == "–" and entry("", float("nan"), "N").value == "not finite"
    assert entry("", 7.3e-8, "m^2").value == "0.073"
    assert (of_scene("1e-06 m/s"), of_scene("inf"), of_scene(True), of_scene([1, "2.0 s"])) == (
        "1 µm/s", "inf", "yes", "1, 2 s",
    )  # fmt: skip


@pytest.mark.skipif(executable() is None, reason="no Chromium here: the page is not looked at by a browser")
def test_a_browser_shows_it_without_a_fault(folder, study, tmp_path):
    page = report(folder, out=tmp_path / "page.html")
    with Browser(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        caption = "document.querySelector('.caption').textContent"
        assert browser.run(caption).startswith("1 of 3")
        first = browser.run("document.getElementById('map').src")
        place = browser.run("document.querySelector('#chart-force .slide').getAttribute('cx')")
        browser.click("#slider", 0.99)
        assert browser.run(caption).startswith("3 of 3: retraction")
        assert browser.run("document.getElementById('map').src") != first
        assert browser.run("document.querySelector('#chart-force .slide').getAttribute('cx')") != place
        browser.click(".kinds button:nth-child(3)")
        assert browser.run("document.querySelector('.ramp') !== null")
        # What is dragged over is looked at more closely; the key 0 shows all again.
        view = "JSON.stringify(charts[0].view)"
        whole = browser.run(view)
        browser.run("charts[0].plot.scrollIntoView({block: 'center'})")
        x, y = browser.run("(() => { const b = charts[0].plot.getBoundingClientRect(); return [b.x, b.y]; })()")
        browser.mouse("mousePressed", x + 200, y + 50)
        browser.mouse("mouseMoved", x + 300, y + 90)
        browser.mouse("mouseReleased", x + 400, y + 150)
        closer = browser.run("charts[0].view.right - charts[0].view.left")
        assert closer < 0.5 * browser.run("(w => w.right - w.left)(charts[0].whole())")
        browser.run("charts[0].plot.focus()")
        browser.key("0")
        assert browser.run(view) == whole
        browser.click("#chart-force .legend button")
        assert browser.run("charts[0].hidden.size") == 1
        assert [browser.overflow(width) for width in (400, 1400)] == [0, 0]
        browser.paper(tmp_path / "page.pdf")
        assert browser.faults == []
        browser.open(report(study, out=tmp_path / "study.html").as_uri())
        assert browser.run(caption).startswith("1 of 3") and browser.overflow(400) == 0
        assert browser.faults == []


def test_it_is_a_command_and_a_function(folder, tmp_path, capsys):
    from pgfmd.cli import main

    for option, value in (("--offset", "1 um"), ("--cycle", "2")):
        with pytest.raises(SystemExit) as refused:
            main(["report", str(folder), option, value])
        told = capsys.readouterr().err
        assert refused.value.code == 2 and option in told and "goes with --measured" in told
    with pytest.raises(TypeError, match="offset is for measured curves"):
        report(folder, offset=1e-6)
    with pytest.raises(SystemExit) as end:
        main(["report", str(folder), "--out", str(tmp_path / "x.html")])
    assert end.value.code == 0 and capsys.readouterr().out.strip() == str(tmp_path / "x.html")
    assert pgfmd.report is report
