"""The studies behind docs/paper.md: files, shared runs, the page, and one figure from a tiny run to its table."""

import re
import sys
from functools import partial
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from marked_page import filled  # noqa: E402
from paper import HERE, page  # noqa: E402
from paper import run as driver  # noqa: E402
from paper.drawing import Claim, Drawing  # noqa: E402
from paper.pool import SIZES, Pool  # noqa: E402
from paper.registry import FIGURES, STUDIES  # noqa: E402

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
    # What is written does not count, whichever of them says it.
    bare = [scene.model_copy(update={"output": scenes[0].output, "title": ""}) for scene in scenes]
    assert all(one != other for k, one in enumerate(bare) for other in bare[:k])
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
    from pgfmd.parts import series_of

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


def test_what_is_not_finished_is_not_drawn(tmp_path, capsys):
    assert driver.main(["hex", "--size", "quick", "--out", str(tmp_path), "--draw-only"]) == 0
    assert "hex: not drawn, none of its runs is finished" in capsys.readouterr().out
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


def test_the_page_is_what_its_numbers_make_it():
    assert filled(PAGE, "figure", partial(page.block, folder=page.FOLDER)) == PAGE
    for name in re.findall(r"\]\(figures/paper/([\w-]+\.png)\)", PAGE):
        assert (page.FOLDER / name).stat().st_size < 400_000
