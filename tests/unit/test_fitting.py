"""A fit of a scene to a measured curve: the search, how well its answer is known, the runs that it makes, and the command."""

import csv
import dataclasses
import json
import math

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd import Scene, cli, simulate
from pgfmd.analysis.experiment import read_experiment
from pgfmd.errors import MeasurementError, SceneError, Stopped
from pgfmd.fitting import runs as runs_module
from pgfmd.fitting.fit import fit, levels_of
from pgfmd.fitting.least_squares import autocorrelation_time, certainty, search
from pgfmd.fitting.misfit import Corrections, Misfit
from pgfmd.fitting.parameters import FitError, Parameter, parameters_of
from pgfmd.fitting.runs import NotConverged, Runs
from pgfmd.runner import run_scene
from pgfmd.studies.campaign import Unfinished
from pgfmd.studies.pool import Ending

SPHERE = {
    "grid.n": "16", "punch.pattern": "sphere", "punch.curvature_radius": "1 mm", "punch.radius": "200 um",
    "substrate.boundary": "free", "rheology.model": "single", "rheology.modulus_ratio": "50", "drive.speed": "20 um/s",
    "rheology.relaxation_time": "2 ms", "drive.preload": "2 mN", "adhesion.range": "3 um", "output.energy": "false",
}  # fmt: skip
GAMMA, TAU = "adhesion.work_of_adhesion", "rheology.relaxation_time"
TRUE = {GAMMA: 0.05, TAU: 2e-3}
START = [f"{GAMMA}=0.042 J/m^2", f"{TAU}=2.6 ms"]


def changes(**others):
    return [f"{key}={value}" for key, value in (SPHERE | others).items()]


@pytest.fixture(scope="module")
def curve(tmp_path_factory):
    """A measured curve: the scene with the true numbers by fine steps, with noise of half a percent of the preload."""
    tables = {}
    for key, value in (SPHERE | {GAMMA: "0.05 J/m^2"}).items():
        section, _, name = key.rpartition(".")
        tables.setdefault(section, {})[name] = value if not value.isdigit() else int(value)
    tables["output"]["energy"], tables["rheology"]["modulus_ratio"] = False, 50
    tables["solver"] = {"accuracy": 1e-3}
    loop = simulate(Scene("tri-tack", **tables)).loop
    force = loop.force + np.random.default_rng(1).normal(0.0, 1e-5, loop.force.size)
    path = tmp_path_factory.mktemp("curve") / "measured.csv"
    rows = np.column_stack([1e6 * loop.indentation, 1e3 * force])
    np.savetxt(path, rows, delimiter=",", header="displacement (um),force (mN)", comments="")
    return path


@pytest.fixture
def here(monkeypatch):
    """Runs of a fit are made in this process, one after the other; the number of them."""
    made = []

    def run(self, tasks, on_end):
        for task in tasks:
            *arguments, _, folder = task.arguments
            every = arguments.index("--checkpoint-every")
            from pgfmd.scene import load_scene

            run_scene(load_scene(arguments[0], arguments[1:every]), MPI.COMM_SELF, folder, lambda line: None)
            made.append(task.name)
            on_end(task, Ending(0, "", 0.0))

    monkeypatch.setattr("pgfmd.studies.pool.Pool.run", run)
    return made


def runs_for(curve, out, keys=(GAMMA, TAU), overrides=(), bounds=(), **options):
    given = (*changes(), *START, *overrides)
    from pgfmd.scene import load_scene

    parameters = parameters_of(load_scene("tri-tack", given), list(keys), dict(bounds))
    return Runs("tri-tack", given, parameters, Misfit(read_experiment(curve)), out, say=lambda line: None, **options)


def command(curve, *arguments):
    with pytest.raises(SystemExit) as caught:
        cli.main(["fit", "tri-tack", str(curve), *changes(), *START, *arguments])
    return caught.value.code


def test_known_numbers_are_recovered_within_their_uncertainty_and_found_again(curve, tmp_path, here, capsys):
    assert command(curve, "--free", f"{GAMMA},{TAU}", "--out", str(tmp_path)) == 0
    said = capsys.readouterr().out
    assert "fitted.toml" in said and "95 %" in said and "note:" not in said
    record = json.loads((tmp_path / "fit.json").read_text())
    for key, true in TRUE.items():
        value, error, (low, high) = (record[what][key] for what in ("values", "standard_errors", "intervals_95"))
        assert low < true < high and abs(value - true) < 3 * error < 0.25 * true, key
    assert record["converged"] and 1e-5 < record["misfit"]["misfit_N"] < 5e-5
    rows = list(csv.DictReader((tmp_path / "runs.csv").open()))
    assert len(rows) == len(here) < 40 and {row["purpose"] for row in rows} == {"search", "derivative"}
    assert float(rows[0][f"{GAMMA} [J/m^2]"]) == 0.042 and float(rows[0]["misfit [N]"]) > 5e-5
    assert Scene(tmp_path / "fitted.toml").adhesion.work_of_adhesion == record["values"][GAMMA]
    assert (tmp_path / "fit.png").stat().st_size > 10000
    # The same again, with its runs there already.
    here.clear()
    again = fit(runs_for(curve, tmp_path), (16,), lambda line: None)
    assert dict(zip(TRUE, again.values, strict=True)) == record["values"] and here == []
    correlation = again.certainty.correlation
    np.testing.assert_allclose(correlation, record["correlation_matrix"])
    assert np.all(np.abs(correlation) <= 1 + 1e-12)


def test_what_can_not_be_fitted_is_refused(curve, tmp_path, here, capsys):
    assert command(curve, "--free", "adhesion.gamma") == 2
    assert command(curve, "--free", GAMMA, "--bounds", GAMMA) == 2
    assert "expected KEY=LOW:HIGH" in capsys.readouterr().err
    # The range is given, so that nothing follows from its factor.
    with pytest.raises(
        FitError, match=r"adhesion\.range_factor: changed by 10 %, it does not move the curve"
    ) as caught:
        fit(runs_for(curve, tmp_path, [GAMMA, "adhesion.range_factor"]), (16,), lambda line: None)
    assert caught.value.exit_code == 2
    with pytest.raises(FitError, match=r"the run at the start could not be made.*\n.*grid\.n = 4"):
        fit(
            runs_for(curve, tmp_path, ["punch.radius"], ["punch.radius=0.37 mm"], {"punch.radius": "0.3 mm:1 mm"}), (4,)
        )
    with pytest.raises(NotConverged, match="--most-runs 1") as caught:
        fit(runs_for(curve, tmp_path, most=1), (16,), lambda line: None)
    assert caught.value.exit_code == 3


def test_a_fit_that_is_stopped_goes_on(curve, tmp_path, here, monkeypatch):
    plain = runs_module.Campaign.run
    calls = []

    def stopped(self, ranks, jobs):
        calls.append(1)
        if len(calls) == 2:
            raise Unfinished("stopped", failed=False)
        plain(self, ranks, jobs)

    monkeypatch.setattr(runs_module.Campaign, "run", stopped)
    with pytest.raises(Unfinished) as caught:
        fit(runs_for(curve, tmp_path, [GAMMA]), (16,), lambda line: None)
    assert caught.value.exit_code == Stopped.exit_code and len(here) == 1


# -- the search --------------------------------------------------------------------------------------------------------

LINE = np.linspace(0.0, 1.0, 100)
ONE = Parameter("adhesion.work_of_adhesion", 0.02, 2e-4, 2.0, 0.0)
TWO = Parameter("adhesion.range", 1e-6, 1e-8, 1e-4, 0.0)


def model(x):
    return np.exp(x[0]) * np.sin(3 * LINE) + 1e4 * np.exp(x[1]) * LINE**2


def test_the_search_and_its_errors_agree_with_linear_theory():
    rng, truth = np.random.default_rng(4), np.log([0.05, 4e-6])
    ends, told = [], []
    for _ in range(40):
        measured = model(truth) + rng.normal(0.0, 1e-3, LINE.size)
        found = search(
            lambda xs, _, measured=measured: [model(x) - measured for x in xs],
            measured,
            [ONE, TWO],
            np.log([0.02, 1e-6]),
            1e-5,
            50,
        )
        assert found.converged
        ends.append(found.x - truth)
        jacobian = np.column_stack([np.exp(found.x[0]) * np.sin(3 * LINE), 1e4 * np.exp(found.x[1]) * LINE**2])
        known = certainty(jacobian, found.residuals, measured, math.nan)
        told.append(known.errors)
        covariance = np.linalg.inv(jacobian.T @ jacobian)
        spread = np.sqrt(np.diag(covariance))
        np.testing.assert_allclose(known.correlation, covariance / np.outer(spread, spread))
    ends, told = np.array(ends), np.array(told)
    # 40 samples tell a standard deviation to 11 %; the autocorrelation of noise is a little above 1.
    np.testing.assert_allclose(np.sqrt(np.mean(told**2, axis=0)), ends.std(axis=0), rtol=0.35)
    assert np.mean(np.abs(ends) < known.factor * told) > 0.9


def test_bounds_hold_and_runs_that_fail_turn_the_search_back():
    measured = model(np.log([0.05, 4e-6]))

    def evaluate(xs, purpose):
        # Beyond this no run can be made.
        return [None if x[0] > math.log(0.07) else model(x) - measured for x in xs]

    found = search(evaluate, measured, [ONE, TWO], np.log([0.02, 1e-6]), 1e-6, 50)
    np.testing.assert_allclose(np.exp(found.x), [0.05, 4e-6], rtol=1e-3)
    narrow = dataclasses.replace(ONE, high=0.03)
    found = search(
        lambda xs, _: [model(x) - measured for x in xs], measured, [narrow, TWO], np.log([0.02, 1e-6]), 1e-6, 50
    )
    assert np.exp(found.x[0]) == pytest.approx(0.03, rel=1e-3)
    with pytest.raises(FitError, match="start could not be made"):
        search(lambda xs, _: [None for x in xs], measured, [ONE, TWO], np.log([0.02, 1e-6]), 1e-6, 50)


def test_residuals_alike_count_for_fewer_places():
    noise = np.random.default_rng(2).normal(size=4000)
    assert autocorrelation_time(noise) == pytest.approx(1.0, abs=0.15)
    # An autoregressive series: (1 + a)/(1 - a).
    series = noise.copy()
    for k in range(1, series.size):
        series[k] += 0.8 * series[k - 1]
    assert autocorrelation_time(series) == pytest.approx(9.0, rel=0.25)
    assert autocorrelation_time(np.ones(5)) == 1.0
    jacobian = np.column_stack([np.sin(3 * LINE), LINE**2])
    rough, smooth = 1e-3 * noise[:100], 1e-3 * np.sin(9 * LINE)
    few, many = (certainty(jacobian, residuals, LINE, math.nan).independent for residuals in (smooth, rough))
    assert few < 20 < 60 < many
    # Errors of the runs' steps: all forces off by a share shift numbers of the forces' own shape by as much.
    known = certainty(jacobian, 1e-9 * rough, 2.0 * jacobian[:, 0], 0.01)
    np.testing.assert_allclose(known.numerical, [0.02, 0.0], atol=1e-12)
    # And runs that are rough, by as much as their second differences say.
    known = certainty(jacobian, 1e-9 * rough, LINE, 0.0, math.sqrt(6.0) * np.column_stack([jacobian[:, 1], 0 * LINE]))
    np.testing.assert_allclose(known.numerical, [0.0, math.sqrt(0.5)], atol=1e-12)
    with pytest.raises(FitError, match="numbers 1 and 2 of --free move the curve in the same way"):
        certainty(np.column_stack([LINE, 2 * LINE]), rough, LINE, 0.0)


# -- what is fitted, and to what ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "bounds", "word"),
    [
        ([], {}, "name at least one key"), (["adhesion.work_of_adhesive"], {}, r"did you mean adhesion\.work_of_adhesion\?"),
        ([GAMMA, GAMMA], {}, "named twice"), (["grid.n"], {}, "one number"), (["solver.accuracy"], {}, "one number"),
        (["punch.exponent"], {}, "that it uses"), (["substrate.prestrain"], {}, "one number"),
        (["substrate.thickness"], {}, "no finite value to start from"), (["drive.dwell"], {}, "starts at its limit"),
        ([GAMMA], {TAU: "1 ms:2 ms"}, "is not fitted"), ([GAMMA], {GAMMA: "20 mJ/m^2"}, "expected LOW:HIGH"),
        ([GAMMA], {GAMMA: "1 mm:2 mm"}, "is a length"), ([GAMMA], {GAMMA: "2 J/m^2:1 J/m^2"}, "the lower one first"),
        ([GAMMA], {GAMMA: "1 J/m^2:2 J/m^2"}, "the start, 0.05, is not between"), (["drive.clearance"], {}, "may have any sign"),
    ],
)  # fmt: skip
def test_keys_and_bounds_that_can_not_be_fitted_are_refused(keys, bounds, word):
    with pytest.raises(FitError, match=word):
        parameters_of(Scene("tri-tack"), keys, bounds)


def test_numbers_are_searched_for_in_shares_within_their_limits():
    scene = Scene("tri-tack", substrate={"poisson_ratio": 0.45})
    bounds = {GAMMA: "20 mJ/m^2:80 mJ/m^2", "substrate.poisson_ratio": "0.2:0.6", "drive.clearance": "-1 um:1 um"}
    keys = [GAMMA, "rheology.modulus_ratio", "substrate.poisson_ratio", "drive.clearance"]
    gamma, ratio, poisson, clearance = parameters_of(scene, keys, bounds)
    assert (gamma.low, gamma.high) == pytest.approx((0.02, 0.08))
    assert ratio.limit == 1.0 and ratio.low == pytest.approx(1 + (ratio.start - 1) / 100)
    assert poisson.high == 0.5 and clearance.limit is None and clearance.unit == "m"
    for one in (gamma, ratio, poisson, clearance):
        assert one.value(one.place(one.start)) == pytest.approx(one.start, rel=1e-12)
        slope = (one.value(one.place(one.start) + 1e-6) - one.value(one.place(one.start) - 1e-6)) / 2e-6
        assert one.slope(one.place(one.start)) == pytest.approx(slope, rel=1e-4)
    assert gamma.value(10.0) == gamma.high


ARRAYS = ("time", "displacement", "force", "area", "u_inf", "phase", "jump")
PRONY = """[punch]
pattern = "sphere"
curvature_radius = "1 mm"
radius = "200 um"
[adhesion]
work_of_adhesion = "50 mJ/m^2"
[drive]
speed = "20 um/s"
preload = "2 mN"
[substrate]
youngs_modulus = "100 MPa"
poisson_ratio = 0.495
[rheology]
model = "prony"
reference = "REFERENCE"
kappa = [0.5, 0.4]
tau = ["1 ms", "20 ms"]
[grid]
n = 16
length = "1 mm"
"""


@pytest.mark.parametrize("given", [(), ("rheology.reference=instantaneous",)])
def test_a_fitted_modulus_is_the_relaxed_one(tmp_path, given):
    from pgfmd.scene import load_scene

    path = tmp_path / "scene.toml"
    path.write_text(PRONY.replace("REFERENCE", "instantaneous" if not given else "relaxed"))
    whole = load_scene(path, given)
    (modulus,) = parameters_of(whole, ["substrate.youngs_modulus"], {})
    assert modulus.start == pytest.approx(1e7)
    runs = Runs(str(path), given, [modulus], None, tmp_path)
    for value in (modulus.start, 2e7):
        found = load_scene(path, runs.changes(16, [value]))
        assert found.substrate.youngs_modulus == value and found.rheology == whole.rheology
    assert found.rheology.kappa == pytest.approx((5.0, 4.0))
    other = Runs(str(path), given, [dataclasses.replace(modulus, key=GAMMA)], None, tmp_path)
    assert load_scene(path, other.changes(16, [0.05])).substrate == whole.substrate


def test_levels_are_halves_of_the_grid():
    assert levels_of("tri-tack", ["grid.n=256"]) == (64, 128, 256)
    assert levels_of("tri-tack", ["grid.n=96"]) == (48, 96)
    assert levels_of("tri-tack", ["grid.n=33"]) == (33,)
    assert levels_of("tri-tack", ["grid.n=256"], 256) == (256,)
    assert levels_of("tri-tack", ["grid.n=256"], 32) == (32, 64, 128, 256)
    with pytest.raises(FitError, match="--from 100"):
        levels_of("tri-tack", ["grid.n=256"], 100)
    with pytest.raises(SceneError):
        levels_of("tri-tack", ["grid.n=3"])


def test_the_misfit_is_that_of_the_same_place(curve):
    """A loop against itself, moved and scaled."""
    loop = read_experiment(curve)
    depth, forces, measured = Misfit(loop).forces(loop)
    np.testing.assert_allclose(forces, measured, rtol=0, atol=0.15 * loop.force.max())
    assert np.sqrt(np.mean((forces - measured) ** 2)) < 5e-5
    half = depth.size // 2
    assert np.all(np.diff(depth[:half]) >= 0) and np.all(np.diff(depth[half:]) >= 0)
    # Pushed in by as much as it was moved, it is the same again.
    moved = dataclasses.replace(loop, displacement=loop.displacement - 1e-6)
    shifted = Misfit(moved, Corrections(offset=-1e-6)).forces(loop)
    np.testing.assert_allclose(shifted[1] - shifted[2], forces - measured, rtol=0, atol=1e-12)
    fitted = Misfit(moved, Corrections(offset=None)).forces(loop)
    np.testing.assert_allclose(fitted[1] - fitted[2], forces - measured, rtol=0, atol=1e-4)
    np.testing.assert_allclose(Misfit(loop).forces_measured, measured)
    # One branch alone counts for itself, and the one that was not measured for nothing.
    turn = loop.preload_row
    for name, rows, same in (
        ("approach", slice(0, turn + 1), slice(0, half)),
        ("retraction", slice(turn, None), slice(half, None)),
    ):
        part = dataclasses.replace(
            loop, **{field: getattr(loop, field)[rows] for field in ARRAYS},
            closed=False,
        )  # fmt: skip
        alone = Misfit(part)
        assert alone.branches == (name,)
        np.testing.assert_allclose(
            np.stack(alone.forces(loop)), np.stack([depth, forces, measured])[:, same], atol=1e-12
        )
    few = dataclasses.replace(part, **{field: getattr(part, field)[:2] for field in ARRAYS})
    with pytest.raises(
        MeasurementError, match="expected at least 4 rows in the approach, or in the retraction, found 2"
    ):
        _ = Misfit(few).forces_measured
