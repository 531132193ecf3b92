"""The studies behind docs/evidence/paper.md: files, shared runs, the page, and one figure from a tiny run to its table."""

import csv
import math
import re
from functools import partial

import pytest

from scripts.studies.pages import filled
from scripts.studies.paper import HERE, page
from scripts.studies.paper import run as driver
from scripts.studies.paper.drawing import (
    CONTACT,
    OVERLAP,
    Claim,
    Drawing,
    area_below,
    count_of,
    covered,
    in_contact,
    percent,
    share_below,
)
from scripts.studies.paper.pool import SIZES, Pool, Run
from scripts.studies.paper.registry import FIGURES, STUDIES

PAGE = page.PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def pools():
    # Reading them confirms every case of every size.
    return {size: Pool(STUDIES, size) for size in SIZES}


def test_every_study_belongs_to_a_figure_and_every_figure_to_the_page():
    assert sorted(STUDIES) == sorted(path.stem for path in HERE.glob("*.toml"))
    assert sorted(re.findall(r"<!-- figure ([\w-]+) -->", PAGE)) == sorted(FIGURES)


@pytest.mark.parametrize("size", SIZES)
def test_a_scene_is_run_once_however_many_studies_have_it(pools, size):
    pool = pools[size]
    scenes = [entry.case().scene for entry in pool.entries.values()]
    bare = [scene.model_copy(update={"output": scenes[0].output, "title": ""}) for scene in scenes]
    assert len(set(bare)) == len(bare)
    # The contact maps and the cell's surface come from a tack test of the study before.
    shared = pool.cases["contact/default" if size == "reduced" else "cell/run"]
    assert shared.owner.startswith("tri/preload-40mN_speed-1um-s")
    assert shared.surface and len(shared.snapshots) >= 2
    case = pool.cases["cell/run"].case()
    assert case.scene.output.surface and {"0.7 t_pl", "1.0 t_pl"} <= set(case.scene.output.snapshots)


def test_sizes_have_the_grids_that_the_page_promises(pools):
    def at(size, user):
        scene = pools[size].cases[user].case().scene
        return scene.grid.n, scene.adhesion.range, scene.rheology.relaxation_time

    user = "tri/preload-40mN_speed-1um-s"
    n, reach, time = at("paper", user)
    assert (n, time) == (2048, 400e-6) and reach == pytest.approx(0.264e-6, rel=2e-3)
    n, wider, longer = at("reduced", user)
    assert (n, longer / time) == (1024, pytest.approx(2.5)) and wider / reach == pytest.approx(2**0.5)
    # The range halved twice, by the rule; the level in between is the run of the hexagonal pattern.
    assert pools["paper"].cases["halved/2048"].owner == "hex/preload-10mN_speed-25um-s"
    assert at("paper", "halved/2048")[2] == at("paper", "halved/8192-same")[2] == 200e-6
    levels = [at("paper", f"halved/{name}") for name in ("512-rule", "2048", "8192-rule")]
    assert [level[1] / levels[2][1] for level in levels] == pytest.approx([4.0, 2.0, 1.0])
    assert [level[2] / levels[2][2] for level in levels] == pytest.approx([2.5**4, 2.5**2, 1.0])


@pytest.mark.parametrize("pattern", ["tri", "hex"])
@pytest.mark.parametrize("size", SIZES)
def test_the_broad_spectrum_has_the_viscosity_of_model_1(pools, size, pattern):
    from pgfmd.scene_objects import series_of

    load = "40mN" if pattern == "tri" else "10mN"
    series = [series_of(pools[size].cases[f"dma-{pattern}/{name}_preload-{load}_speed-1um-s"].case().scene.rheology)
              for name in ("single", "broad")]  # fmt: skip
    assert [each.elements for each in series] == [1, 20] and series[1].kappa_inf == pytest.approx(1000)
    assert series[0].kappa @ series[0].tau == pytest.approx(series[1].kappa @ series[1].tau, rel=1e-3)
    assert series[1].tau[0] / series[1].tau[-1] == pytest.approx(1e8, rel=1e-4)


def test_a_figure_from_its_runs_to_its_numbers(tmp_path, capsys, monkeypatch):
    # Reading the cases of the other studies takes longer than the run.
    monkeypatch.setattr(driver, "STUDIES", FIGURES["compliance"].studies)
    small = ["--set", "grid.n=64", "--set", "drive.preload=2 mN", "--set", "solver.accuracy=0.1"]
    assert driver.main(["compliance", "--size", "quick", "--out", str(tmp_path), *small]) == 0
    said = capsys.readouterr().out
    assert "stiffness k_cc" in said and "not drawn" not in said
    assert (tmp_path / "figures" / "compliance-quick.png").read_bytes().startswith(b"\x89PNG")
    rows = {row["what"]: float(row["ours"]) for row in page.read_rows(tmp_path / "figures")}
    # The surface of the whole cell and the column of the curve are two ways to u_inf; points lie beside the corner.
    assert rows["6 u(L/2, L/2) − 5 u(L/2, 0) from the surface, over u_∞"] == pytest.approx(1.0, abs=0.05)
    assert driver.main(["compliance", "--size", "quick", "--out", str(tmp_path), "--draw-only", *small]) == 0
    assert len(page.read_rows(tmp_path / "figures")) == len(rows)
    scene = Pool(("cell",), "quick", small[1::2]).cases["cell/run"].case().scene
    counts_of_one_run(Run("cell", "run", scene, tmp_path / "cell" / "run"))
    # Without its runs a figure stays as it is, numbers and all.
    (tmp_path / "cell").rename(tmp_path / "away")
    assert driver.main(["compliance", "--size", "quick", "--out", str(tmp_path), "--draw-only", *small]) == 0
    assert "compliance: left as it is: none of its runs is finished" in capsys.readouterr().out
    assert len(page.read_rows(tmp_path / "figures")) == len(rows)
    assert (tmp_path / "figures" / "compliance-quick.png").exists()


def counts_of_one_run(run):
    """The columns of the curve and the maps of the snapshots are two ways to the same counts."""
    assert count_of(run) == CONTACT
    frame = run.results.labels.index("preload")
    limits = {"overlap": 0.0, "contact": run.results.contact_gap, "near": 500e-9}
    every = area_below(run, frame, math.inf)
    shares = {name: 100 * area_below(run, frame, limit) / every for name, limit in limits.items()}
    assert {name: covered(run, name) for name in limits} == pytest.approx(shares, rel=1e-12)
    # The range is longer than 500 nm on such a grid.
    assert 0 < shares["overlap"] < min(shares["contact"], shares["near"]) < 100
    held = in_contact(run.results, run.loop.time[run.loop.preload_row])["summit"]
    assert percent(held) == share_below(run, frame, "summit", limits["contact"]) > 0


def test_what_is_not_finished_is_not_drawn(tmp_path, capsys):
    assert driver.main(["hex", "--size", "quick", "--out", str(tmp_path), "--draw-only"]) == 0
    assert "hex: not drawn: none of its runs is finished" in capsys.readouterr().out
    assert not list((tmp_path / "figures").glob("*.png"))
    told = page.read_captions(tmp_path / "figures")["hex-quick-missing"]
    assert told.startswith("7 of 7 runs; expected: ") and "transform pairs" in told


@pytest.mark.parametrize(
    ("ours", "low", "high", "verdict"),
    [
        (2.6, 2.0, 3.0, "agrees"), (1.5, 2.0, 3.0, "25\N{NO-BREAK SPACE}% below"),
        (3.3, 2.0, 3.0, "10\N{NO-BREAK SPACE}% above"),
        (float("nan"), 2.0, 3.0, "not reached"), (1.0, float("nan"), float("nan"), ""), (0.0, 0.0, 0.0, "agrees"),
        (-3.0, -1.5, -0.5, "below"),
        (2.5, 1.0, 1.0, "150\N{NO-BREAK SPACE}% above"), (0.5, 1.0, 1.0, "50\N{NO-BREAK SPACE}% below"),
    ],
)  # fmt: skip
def test_verdicts(ours, low, high, verdict):
    (row,) = page.rows_of("paper", "hex", [Claim("force", "1 µm/s", ours, "mN", "2.5", low, high)])
    assert page.verdict(row) == verdict


def test_the_page_has_both_sizes_side_by_side_and_keeps_the_rest(tmp_path):
    for size, ours in (("reduced", 2.0), ("paper", 1.25)):
        drawing = Drawing(None, f"at {size}", [Claim("pull-off", "quasi-static", ours, "mN", "1.2", 1.15, 1.3)])
        page.keep(tmp_path, size, "hex", drawing, FIGURES)
        page.keep(tmp_path, size, "hex", drawing, FIGURES)
    (tmp_path / "hex-paper.png").write_bytes(b"")
    block = partial(page.block, folder=tmp_path)
    text = filled("before\n\n<!-- figure hex -->\nold\n<!-- end -->\n\nafter\n", "figure", block)
    assert "| pull-off [mN] | quasi-static | 1.2 | 2 | 1.25 | agrees |" in text
    assert text.startswith("before\n\n<!-- figure hex -->\n\n![hex, paper's size]") and text.endswith("after\n")
    assert "*at paper*" in text and "at reduced" not in text and "old" not in text
    assert filled(text, "figure", block) == text


def claims(*rows):
    return Drawing(None, "", [Claim(*row[:3], "mN", "about 4", 3.5, 4.5, *row[3:]) for row in rows])


def test_no_number_of_another_count_passes_as_one_of_contact(tmp_path):
    both = claims(("closed", "1 mN", 8.0, OVERLAP), ("closed", "2 mN", 9.0, OVERLAP), ("pull-off", "1 mN", 3.0))
    page.keep(tmp_path, "reduced", "hex", both, FIGURES, runs=("hex/one", "hex/two"))
    text, below = page.block("hex", tmp_path), "| 3 | 14\N{NO-BREAK SPACE}% below |"
    assert "| closed [mN] | 1 mN | about 4 | not counted again |  |" in text and below in text
    assert "Not counted again (reduced): 2 of the numbers" in text and "| 8" not in text
    assert page.read_runs(tmp_path) == {"hex-reduced": ["hex/one", "hex/two"]}
    # One of the runs is made again: of its numbers only the one that counts contact is replaced.
    new = ("new", "1 mN", 4.0, CONTACT, math.nan)
    again = claims(("closed", "1 mN", 4.25, CONTACT, 8.0), ("pull-off", "1 mN", 3.7), new)
    page.recount(tmp_path, "reduced", "hex", again, FIGURES)
    text = page.block("hex", tmp_path)
    assert "| closed [mN] | 1 mN | about 4 | 4.25 | agrees |" in text
    assert "| closed [mN] | 2 mN | about 4 | not counted again |  |" in text and below in text
    assert "| new [mN] | 1 mN | about 4 | 4 | agrees |" in text and "(reduced): 1 of the numbers" in text
    # A larger size with the other count is no verdict.
    page.keep(tmp_path, "paper", "hex", claims(("closed", "1 mN", 7.0, OVERLAP)), FIGURES)
    assert "| closed [mN] | 1 mN | about 4 | 4.25 | not counted again | agrees |" in page.block("hex", tmp_path)
    # Before and after of what is counted anew, and of nothing else.
    _, _, closed, added = page.counts_block(tmp_path, FIGURES).splitlines()
    assert closed.startswith("| hex | closed [mN] | 1 mN | reduced | about 4 | 8 | 78\N{NO-BREAK SPACE}% above | 4.25")
    assert added == "| hex | new [mN] | 1 mN | reduced | about 4 | never | not reached | 4 | agrees |"


def test_numbers_of_the_old_count_are_of_rows_that_there_are():
    here = {(row["size"], row["figure"], row["what"], row["settings"]): row for row in page.read_rows(page.FOLDER)}
    with page.OLD_COUNT.open(encoding="utf-8", newline="") as file:
        old = list(csv.DictReader(file))
    for row in old:
        # A row whose name has changed would have no before and nobody would see it.
        assert here[row["size"], row["figure"], row["what"], row["settings"]]["count"] in (CONTACT, OVERLAP)


def test_the_page_is_what_its_numbers_make_it():
    assert filled(PAGE, "figure", partial(page.block, folder=page.FOLDER)) == PAGE
    counts = page.counts_block(page.FOLDER, FIGURES)
    assert filled(PAGE, "count", lambda _: counts) == PAGE
    for name in re.findall(r"\]\((?:\.\./)*figures/paper/([\w-]+\.png)\)", PAGE):
        assert (page.FOLDER / name).stat().st_size < 400_000
