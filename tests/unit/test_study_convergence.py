"""Power laws: known ones are found, with honest errors; what is none is said to be none. Levels of a refinement."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgfmd.errors import ResultError, SceneError
from pgfmd.reference import jkr
from pgfmd.scene import load_scene
from pgfmd.studies import refinement
from pgfmd.studies.cases import Case
from pgfmd.studies.convergence import HIGHEST, LOWEST, disagreement, doubts, finest_limit, fit_power_law, local_powers
from pgfmd.studies.extrapolation import extrapolate, plot_convergence, report, write
from pgfmd.studies.refinement import HYSTERESIS_POWER, MEASURES, expected_power, levels_of
from pgfmd.studies.standing import FINISHED, Standing
from pgfmd.studies.table import rows_of

SIZES = 2.0 ** -np.arange(5)


def law(sizes, limit=2.0, amplitude=0.7, power=1 / 3):
    return limit + amplitude * np.asarray(sizes) ** power


# -- fits --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("power", [0.1, 1 / 3, 0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("amplitude", [0.7, -3e-4])
def test_an_exact_law_is_found(power, amplitude):
    q = law(SIZES, 2.0, amplitude, power)
    fit = fit_power_law(SIZES, q)
    assert fit.free and fit.power == pytest.approx(power, rel=1e-6)
    assert fit.limit == pytest.approx(2.0, abs=2e-6 * abs(amplitude))
    assert fit.amplitude == pytest.approx(amplitude, rel=1e-5)
    assert fit.left_out == pytest.approx((2.0, 2.0), abs=1e-4 * abs(amplitude))
    assert fit_power_law(SIZES, q, power).limit == pytest.approx(2.0, abs=1e-12)
    # Of a small power, most of the way is still to go.
    far = ["the extrapolation goes further than all that was computed"] if power < 0.25 else []
    assert doubts(SIZES, q, fit) == far and disagreement(fit, fit.power) == ""
    assert local_powers(SIZES, q) == pytest.approx([power] * 3, rel=1e-6)
    assert finest_limit(SIZES, q, power) == pytest.approx(2.0, abs=1e-12)
    assert fit(SIZES) == pytest.approx(q, abs=1e-9)


def test_the_scale_of_sizes_and_values_does_not_matter():
    one, other = fit_power_law(SIZES, law(SIZES)), fit_power_law(3e-7 * SIZES, 1e-9 * law(SIZES))
    assert other.power == pytest.approx(one.power, rel=1e-6)
    assert other.limit == pytest.approx(1e-9 * one.limit, rel=1e-6)


def test_order_of_the_levels_does_not_matter():
    q = law(SIZES) + 1e-3 * np.array([1, -1, 1, 1, -1])
    one, other = fit_power_law(SIZES, q), fit_power_law(SIZES[::-1], q[::-1])
    assert other.limit == pytest.approx(one.limit, rel=1e-6)
    assert doubts(SIZES[::-1], q[::-1], other) == doubts(SIZES, q, one)


@pytest.mark.parametrize("power", [1 / 3, None])
def test_errors_and_intervals_are_those_of_the_scatter(power):
    """Over many draws of noise, the 95 % interval holds the truth in 95 % of them."""
    generator, hits, deviations = np.random.default_rng(7), [], []
    sizes = 2.0 ** -np.arange(8)
    for _ in range(150):
        fit = fit_power_law(sizes, law(sizes) + generator.normal(0.0, 1e-3, sizes.size), power)
        low, high = fit.limit_interval
        hits.append(low <= 2.0 <= high)
        deviations.append((fit.limit - 2.0) / fit.limit_error)
    assert 0.90 <= np.mean(hits) <= 0.99
    assert 0.8 <= np.median(np.abs(deviations)) / 0.6745 <= 1.4


def test_as_many_parameters_as_points_have_no_error():
    fit = fit_power_law(SIZES[:2], law(SIZES[:2]), 1 / 3)
    assert fit.limit == pytest.approx(2.0) and math.isnan(fit.limit_error) and math.isnan(fit.limit_interval[0])
    assert math.isnan(fit.left_out[0])
    assert math.isnan(fit_power_law(SIZES[:3], law(SIZES[:3])).power_error)


@pytest.mark.parametrize(
    ("sizes", "values"),
    [([1.0], [1.0]), ([1.0, 1.0, 1.0], [1.0, 2.0, 3.0]), ([1.0, 0.5], [1.0, math.nan]), ([1.0, 0.0], [1.0, 2.0]),
     ([1.0, 0.5], [1.0])],
)  # fmt: skip
@pytest.mark.parametrize("power", [None, 1.0])
def test_degenerate_input_is_refused(sizes, values, power):
    with pytest.raises(ValueError, match=r"must be finite and as many of each|different sizes are needed"):
        fit_power_law(sizes, values, power)


# -- doubts ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([1.0, 1.0, 1.0, 1.0], "the values are equal"),
        ([1.0, 2.0, 1.5, 1.8], "rise and fall"),
        ([1.0, 1.1, 1.3, 1.7], "do not shrink"),
        ([1.0, 1.1, 1.3, 1.7], f"end of what was looked for, {LOWEST:g}"),
        ([2.0, 1.0, 1.0 - 1e-4, 1.0 - 2e-4], f"{LOWEST:g} to {HIGHEST:g}"),
        (law(SIZES[:4], power=0.15), "further than all that was computed"),
        ([2.6024, 1.4296, 1.0455, 0.89316, 0.80773], "the power between levels drifts, 1.6, 1.3, 0.83"),
        (law(SIZES[:4], 0.02, 1.0, 0.2) - 0.2, "negative"),
    ],
)
def test_what_is_no_power_law_is_doubted(values, said):
    sizes = SIZES[: len(values)]
    assert said in "\n".join(doubts(sizes, values, fit_power_law(sizes, values)))


def test_a_wrong_power_leaves_residuals_and_is_told():
    q = law(SIZES, power=1.5)
    assert any("residuals are" in text for text in doubts(SIZES, q, fit_power_law(SIZES, q, 1 / 3)))
    assert "is not the expected 0.333" in disagreement(fit_power_law(SIZES, q), 1 / 3)


def test_few_levels_and_noisy_values_are_told():
    q = law(SIZES[:3])
    fit = fit_power_law(SIZES[:3], q, 1 / 3)
    assert "only 3 levels: the power itself can't be tested" in doubts(SIZES[:3], q, fit)
    q = law(SIZES)
    assert "larger than the last difference" in doubts(SIZES, q, fit_power_law(SIZES, q), noise=0.1)[0]


# -- levels ------------------------------------------------------------------------------------------------------------


def test_rho_falls_as_fast_as_the_grid_allows():
    levels = levels_of("tri-tack", ["grid.n=64"], "rho", 5)
    scenes = [case.scene for case in levels.cases]
    assert [scene.grid.n for scene in scenes] == [64, 128, 256, 512, 1024]
    reaches = [scene.adhesion.range for scene in scenes]
    # Two doublings of n halve it.
    assert reaches[2] == pytest.approx(reaches[0] / 2) and reaches[4] == pytest.approx(reaches[0] / 4)
    assert levels.size_of(levels.cases[1]) == pytest.approx(1.5e-3 / 128) and levels.remarks == []


def test_rho_stays_where_n_is_refined():
    automatic = levels_of("tri-tack", ["grid.n=64"], "n", 3, start="100")
    assert [case.scene.grid.n for case in automatic.cases] == [100, 200, 400]
    assert len({case.scene.adhesion.range for case in automatic.cases}) == 1
    own = levels_of("tri-tack", ["grid.n=64", "adhesion.range=2 um"], "n", 2)
    assert [case.scene.adhesion.range for case in own.cases] == [2e-6, 2e-6]


def test_accuracies():
    levels = levels_of("tri-tack", ["grid.n=64"], "accuracy", 3)
    assert [case.scene.solver.accuracy for case in levels.cases] == pytest.approx([1e-2, 10**-2.5, 1e-3], rel=1e-5)
    halved = levels_of("tri-tack", ["grid.n=64"], "accuracy", 3, start="4e-3", factor=2.0)
    assert [levels.size_of(case) for case in halved.cases] == [4e-3, 2e-3, 1e-3]
    with pytest.raises(SceneError, match="a scheme with an accuracy"):
        levels_of("tri-tack", ["grid.n=64", "solver.scheme=gfmd"], "accuracy")


def test_grids_end_at_the_largest_and_at_the_memory(monkeypatch):
    levels = levels_of("tri-tack", ["grid.n=64"], "rho", 4, largest_n=200)
    assert [case.scene.grid.n for case in levels.cases] == [64, 128]
    assert levels.remarks == ["2 of 4 levels: n = 256 is above --largest-n 200"]
    real = refinement.memory_of
    huge = replace(real(levels.cases[0].scene, 1), points=1e15)
    guess = lambda scene, ranks: huge if scene.grid.n > 150 else real(scene, ranks)  # noqa: E731
    monkeypatch.setattr(refinement, "memory_of", guess)
    levels = levels_of("tri-tack", ["grid.n=64"], "rho", 4)
    assert [case.scene.grid.n for case in levels.cases] == [64, 128]
    assert "n = 256 takes 1e+06 GB, this machine has" in levels.remarks[0]
    with pytest.raises(SceneError, match="at least 2 levels"):
        levels_of("tri-tack", ["grid.n=64"], "rho", 4, largest_n=64)


@pytest.mark.parametrize(("start", "factor"), [("many", None), ("0", None), (None, 0.5), (None, 1.0)])
def test_levels_that_make_no_sense(start, factor):
    with pytest.raises(SceneError):
        levels_of("tri-tack", [], "rho", 4, start, factor)


@pytest.mark.parametrize(
    ("axis", "start", "factor", "count", "told"),
    [
        ("n", "24", 1.03, 4, "levels 1, 2 have grid.n = 24; levels 3, 4 have grid.n = 26; --factor 1.07 would do"),
        ("rho", "24", 1.01, 3, "levels 1, 2, 3 have grid.n = 24; --factor 1.07 would do"),
        ("n", "1024", 1.0001, 2, "levels 1, 2 have grid.n = 1024; --factor 1.01 would do"),
        ("accuracy", "0.01", 1.0000001, 2, "levels 1, 2 have solver.accuracy = 0.01; --factor 1.01 would do"),
    ],
)
def test_levels_that_coincide_are_refused(axis, start, factor, count, told):
    with pytest.raises(SceneError) as caught:
        levels_of("tri-tack", [], axis, count, start, factor)
    assert told in str(caught.value) and len(caught.value.problems) == 1
    enough = float(told.rpartition("--factor ")[2].split()[0])
    levels = levels_of("tri-tack", [], axis, count, start, enough)
    assert len({levels.size_of(case) for case in levels.cases}) == count


# -- from rows to a verdict --------------------------------------------------------------------------------------------


def ladder(values, states=None, count=5, residual=1e-3):
    """Levels whose runs have finished with these works of the loop [J]."""
    levels = levels_of("tri-tack", ["grid.n=32"], "rho", count)
    states = states or ["detached"] * count
    standings = {
        case.name: Standing(FINISHED, why, {"work_J": value, "energy_residual": residual})
        for case, value, why in zip(levels.cases, values, states, strict=True)
    }
    return levels, rows_of(levels.cases, (levels.key,), standings)


def test_the_cube_root_is_expected_of_hysteresis_with_rho_alone():
    assert expected_power("rho", "loop") == HYSTERESIS_POWER == pytest.approx(1 / 3)
    assert {expected_power(axis, quantity) for axis in ("n", "accuracy") for quantity in MEASURES} == {None}
    assert expected_power("rho", "pull-off") is None


def test_a_supported_extrapolation(tmp_path):
    levels, rows = ladder(1e-9 * law(SIZES))
    found = extrapolate(levels, rows, "loop")
    assert found.doubts == [] and found.best is found.fixed
    assert found.fixed.limit == pytest.approx(2e-9, rel=1e-9) and found.free.power == pytest.approx(1 / 3, rel=1e-5)
    text = "\n".join(report(found))
    assert "work of the loop [nJ]" in text and "limit 2 ± " in text and "do not support" not in text
    paths = write(tmp_path, found, "a title")
    record = json.loads(paths[0].read_text())
    assert record["supported"] is True and record["unit"] == "J" and len(record["levels"]) == 5
    assert record["levels"][0]["size"] == pytest.approx(1.5e-3 / 32)
    assert paths[1].stat().st_size > 10_000


def test_the_picture_shows_points_fits_and_differences():
    levels, rows = ladder(1e-9 * law(SIZES))
    left, right = plot_convergence(extrapolate(levels, rows, "loop")).axes
    points = left.lines[0]
    assert points.get_xdata() == pytest.approx((1.5e3 / 32 * SIZES) ** (1 / 3))
    assert points.get_ydata() == pytest.approx(law(SIZES))
    # In h^p a power law is a straight line through the points.
    slopes = np.diff(points.get_ydata()) / np.diff(points.get_xdata())
    assert slopes == pytest.approx([slopes[0]] * 4, rel=1e-6)
    assert right.lines[0].get_ydata() == pytest.approx(np.abs(np.diff(law(SIZES))))


def test_runs_that_ended_early_are_left_out_and_told():
    levels, rows = ladder(1e-9 * law(SIZES), ["detached"] * 4 + ["max_steps reached"])
    found = extrapolate(levels, rows, "loop")
    assert len(found.levels) == 4 and found.remarks == ["n-512 is left out: finished (max_steps reached)"]
    levels, rows = ladder(1e-9 * law(SIZES), ["detached"] + ["preload not reached"] * 4)
    with pytest.raises(ResultError, match="1 levels are finished"):
        extrapolate(levels, rows, "loop")


def test_an_audit_that_does_not_close_is_doubted():
    levels, rows = ladder(1e-9 * law(SIZES), residual=0.2)
    assert any("the error of the values" in text for text in extrapolate(levels, rows, "loop").doubts)


def test_without_a_power_three_levels_are_too_few():
    levels, rows = ladder(1e-9 * law(SIZES[:3]), count=3)
    for row in rows:
        row.measured["pull_off_force [N]"] = row.measured["work [J]"]
    found = extrapolate(levels, rows, "pull-off")
    assert found.best is None and "4 levels are needed" in found.doubts[0]
    assert extrapolate(levels, rows, "pull-off", power=1 / 3).fixed.limit == pytest.approx(2e-9)
    assert plot_convergence(found) and report(found)


def test_a_case_of_a_level_is_what_its_run_is_given():
    case = levels_of("tri-tack", ["grid.n=64"], "n", 2).cases[1]
    assert isinstance(case, Case) and case.name == "n-128" and case.places == {"grid.n": "128"}
    assert any(text.startswith("adhesion.range=") for text in case.overrides)


def test_the_known_limit_in_the_docs():
    """JKR's loop: the way back along the curve from the unstrained height to where it turns, all of it under tension."""
    scene = load_scene("hertz", ["adhesion.law=cosine"])
    about = scene.punch.curvature_radius, scene.substrate.contact_modulus, scene.adhesion.work_of_adhesion
    a = np.linspace(1e-5, 400e-6, 100_001)
    depth, force = jkr.indentation(a, *about), jkr.force(a, *about)
    turn = int(np.argmin(depth))
    back = slice(turn, turn + int(np.argmin(np.abs(depth[turn:]))) + 1)
    loop = float(np.sum(-0.5 * (force[back][1:] + force[back][:-1]) * np.diff(depth[back])))
    text = (Path(__file__).parents[2] / "docs" / "how-to" / "studies.md").read_text(encoding="utf-8")
    assert f"is {loop * 1e9:.2f} nJ here" in text
    assert a[back][-1] < scene.punch.radius
