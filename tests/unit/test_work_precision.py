"""Errors between curves, cost at an error, and small studies of both schemes."""

import math
from functools import partial

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd import cli
from pgfmd.benchmark import bench
from pgfmd.benchmark.curve_errors import PULL_OFF, cost_at, errors, richardson, rms_difference
from pgfmd.benchmark.work_precision import Laboratory, Setting, explicit, implicit, study
from pgfmd.errors import RunError, SceneError
from pgfmd.results.curve import Loop, measure

TINY = ("grid.n=32", "drive.speed=400 um/s", "drive.preload=20 mN", "solver.gfmd.fast_pull=1")


def curve(times, forces, areas=None, pull_off=1.0, work=4.0):
    areas = np.abs(forces) if areas is None else areas
    time, force, area = (np.array(values, float) for values in (times, forces, areas))
    rows = len(time)
    phase, jump, told = np.full(rows, "retract"), np.zeros(rows, bool), {PULL_OFF: pull_off}
    return Loop("made", time, 0.0 * time, force, area, 0.0 * time, phase, jump, separation=work, recorded=told)


def triangle(height=2.0, **others):
    """Nothing up to t = 1, then up to a height at t = 2 and down to nothing at t = 3."""
    return curve([0, 1, 2, 3], [0, 0, height, 0], **others)


# Errors --------------------------------------------------------------------------------------------------------------
def test_the_force_error_is_the_rms_over_the_time_of_contact():
    # The difference is a triangle of height 0.3; the rms of a triangle is its height over sqrt(3).
    assert errors(triangle(2.3), triangle(2.0), 2.0).force == pytest.approx(0.3 / math.sqrt(3.0) / 2.0, rel=1e-12)
    # A longer way to the surface changes nothing, nor a longer way after the punch has let go.
    longer = [curve([0, 9, 10, 11], [0, 0, height, 0]) for height in (2.3, 2.0)]
    assert errors(*longer, 2.0).force == pytest.approx(0.3 / math.sqrt(3.0) / 2.0, rel=1e-12)


def test_the_rms_is_exact_for_broken_lines_with_different_steps():
    coarse, fine = curve([0, 4], [1, 1]), curve([0, 1, 2, 3, 4], [1, 3, 1, 3, 1])
    assert rms_difference(coarse, fine, "force") == pytest.approx(2.0 / math.sqrt(3.0), rel=1e-12)
    assert rms_difference(fine, coarse, "force") == rms_difference(coarse, fine, "force")


def test_a_curve_that_ended_early_stays_at_zero():
    early, late = curve([0, 1], [1, 0]), curve([0, 1, 4], [1, 0, 3])
    assert rms_difference(early, late, "force") == pytest.approx(1.5, rel=1e-12)


def test_area_pull_off_and_work_are_relative_to_the_reference():
    reference = curve([0, 1, 2], [1, 1, 1], [0, 5, 0], pull_off=2.0, work=8.0)
    other = curve([0, 1, 2], [1, 1, 1], [0, 4, 0], pull_off=2.2, work=7.0)
    found = errors(other, reference, 2.0)
    assert found.force == 0.0
    assert found.area == pytest.approx(1.0 / math.sqrt(3.0) / 5.0)
    assert (found.pull_off, found.separation) == (pytest.approx(0.1), pytest.approx(0.125))
    assert errors(reference, reference, 2.0) == type(found)(0.0, 0.0, 0.0, 0.0)
    none = curve([0, 1], [1, 1], pull_off=0.0)
    assert errors(none, none, 2.0).pull_off == 0.0 and errors(reference, none, 2.0).pull_off == math.inf


def test_richardson_removes_the_leading_error():
    def disturbed(size, order):
        times = np.linspace(0.0, 3.0, 7 if size == 0.2 else 13)
        bump = 1.0 + size**order
        return curve(times, bump * (1.0 + times), pull_off=3.0 * bump, work=5.0 * bump)

    for order in (1, 2):
        limit = richardson(disturbed(0.2, order), disturbed(0.1, order), 2.0, order)
        np.testing.assert_allclose(limit.force, 1.0 + limit.time, rtol=1e-14)
        np.testing.assert_allclose(limit.area, 1.0 + limit.time, rtol=1e-14)
        assert (limit.recorded[PULL_OFF], limit.separation) == (pytest.approx(3.0), pytest.approx(5.0))


# Cost at an error ----------------------------------------------------------------------------------------------------
def test_cost_is_interpolated_as_a_power_of_the_error():
    costs = np.array([1.0, 10.0, 100.0])
    assert cost_at(0.01, 0.1 * costs**-1.0, costs) == pytest.approx(10.0)
    assert cost_at(1e-2, 0.2 * costs**-2.0, costs) == pytest.approx(math.sqrt(20.0))
    # The order of the settings does not matter.
    assert cost_at(1e-2, 0.2 * costs[::-1] ** -2.0, costs[::-1]) == pytest.approx(math.sqrt(20.0))


def test_cost_where_no_or_every_setting_is_good_enough():
    assert cost_at(0.01, [0.5, 0.1], [1.0, 2.0]) == math.inf
    assert cost_at(0.01, [], []) == math.inf
    assert cost_at(0.01, [0.004, 0.001], [3.0, 5.0]) == 3.0


def test_cost_of_a_line_that_is_not_monotone_is_that_of_its_cheapest_crossing():
    assert cost_at(0.01, [0.1, 0.001, 0.1, 0.0001], [1.0, 4.0, 9.0, 16.0]) == pytest.approx(2.0)
    assert cost_at(0.01, [0.1, 0.0], [1.0, 4.0]) == 4.0


# Settings and runs ---------------------------------------------------------------------------------------------------
def test_settings_say_what_they_change():
    (setting,) = explicit("gfmd", [4], [0.1])
    assert setting.overrides[1:] == (
        f"solver.gfmd.omega_tau={4 * math.pi!r}", "solver.gfmd.steps_per_tau=40.0"
    )  # fmt: skip
    assert (setting.x, setting.label) == (2.0, "omega tau 4 pi, dt tau/40")
    assert len(explicit("gfmd", [2, 4, 8], [0.1])) == len(explicit("gfmd", [2], [0.1, 0.2, 0.3])) == 3
    first, second = implicit("ours", [0.1, 1e-3], "solver.order=1")
    assert first.overrides == ("solver.accuracy=0.1", "solver.order=1") and second.x == 1e-3


@pytest.fixture(scope="module")
def laboratory():
    return Laboratory(MPI.COMM_SELF)


def test_a_run_is_made_once_and_counted(laboratory):
    outcome = laboratory.outcome("tri-tack", TINY)
    assert laboratory.outcome("tri-tack", TINY) is outcome
    assert outcome.curve.time.size == outcome.steps + 1
    assert outcome.pairs > outcome.steps > 5 and outcome.iterations >= 2 * outcome.steps
    assert outcome.seconds > 0.0
    assert outcome.curve.force.max() == pytest.approx(20e-3, rel=0.02) and outcome.preload == 20e-3
    assert outcome.curve.area.max() > 0.0
    assert measure(outcome.curve).pull_off.tension == outcome.curve.recorded[PULL_OFF] > 0.0


def test_both_schemes_approach_the_same_curve_and_gfmd_by_the_first_order(laboratory):
    reference = laboratory.outcome("tri-tack", (*TINY, "solver.accuracy=1e-5")).curve
    settings = [*implicit("inertialess", [0.1, 1e-3]), *explicit("gfmd", [16, 32, 64], [0.5])]
    rows = list(study(laboratory, "tri-tack", TINY, settings, reference, pytest.fail))
    coarse, fine = (row.force_error for row in rows[:2])
    assert fine < 0.2 * coarse < 0.01
    found = [row.force_error for row in rows[2:]]
    assert np.log2(np.divide(found[:-1], found[1:])) == pytest.approx([1.0, 1.0], abs=0.1)
    assert [row.pairs for row in rows[2:]] == [row.steps for row in rows[2:]]
    assert rows[3].steps == pytest.approx(2 * rows[2].steps, rel=0.05)
    curves = [laboratory.outcome("tri-tack", (*TINY, *setting.overrides)).curve for setting in settings[-2:]]
    assert errors(richardson(*curves, 2.0), reference, 20e-3).force < 0.4 * found[-1]


def test_what_a_scene_refuses_is_left_out_with_a_remark(laboratory):
    said = []
    settings = [Setting("new", "x", 0.0, ("solver.nonsense=1",)), *implicit("ours", [0.1])]
    reference = laboratory.outcome("tri-tack", TINY).curve
    rows = list(study(laboratory, "tri-tack", TINY, settings, reference, said.append))
    assert [row.line for row in rows] == ["ours"]
    assert len(said) == 1 and "nonsense" in said[0] and said[0].startswith("new, x")
    with pytest.raises(SceneError):
        laboratory.outcome("tri-tack", (*TINY, "solver.scheme=gfmd", "solver.gfmd.steps_per_tau=1"))


def test_a_run_that_stops_early_is_no_measurement(laboratory):
    with pytest.raises(RunError, match="max_steps"):
        laboratory.outcome("tri-tack", (*TINY, "solver.max_steps=10"))


# pgfmd bench ---------------------------------------------------------------------------------------------------------
def test_bench_prints_a_table_and_a_comparison(monkeypatch, capsys):
    monkeypatch.setattr(bench, "work_precision", partial(bench.work_precision, base=TINY, omega_taus=(2, 64)))
    with pytest.raises(SystemExit) as ended:
        cli.main(["bench"])
    assert ended.value.code == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.startswith("inertialess") for line in lines) == 5
    assert sum(line.startswith("gfmd") for line in lines) == 4
    assert "pairs" in lines[1] and "core-s" in lines[1]
    assert all("transform pairs of gfmd" in line for line in lines[-2:])


def test_a_comparison_without_a_crossing_says_so(laboratory):
    reference = laboratory.outcome("tri-tack", (*TINY, "solver.accuracy=1e-5")).curve
    settings = [
        *implicit(bench.OURS, [1e-3]),
        *explicit(bench.LONGEST, [1], [0.5]),
        *explicit(bench.PAPERS, [16, 32], [0.5]),
    ]
    lines = bench.comparison(list(study(laboratory, "tri-tack", TINY, settings, reference, pytest.fail)))
    assert "1/" in lines[0] and lines[1].startswith(f"{bench.LONGEST} does not come down to 1 %")
