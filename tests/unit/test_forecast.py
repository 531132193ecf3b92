"""What a scene will cost: the forecast against counted runs, its parts against closed forms, and what is run ahead."""

import math

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.commands import check
from pgfmd.forecast import effort as effort_module
from pgfmd.forecast.effort import UNLIKE, ahead_summary, counts_of, effort_of, jump_threshold, kind_of, strokes_of
from pgfmd.forecast.effort_constants import FITTED
from pgfmd.forecast.indentation import MADELUNG, SECOND, depth_at_preload, images_share, punch_speeds, travels_of
from pgfmd.output.snapshot_times import met, run_ahead
from pgfmd.physics.halfspace import HalfSpace
from pgfmd.run_ahead import Met, coarse_scenes, met_by, moments
from pgfmd.scene import load_scene
from pgfmd.scene_objects import SOFT_MACHINE, punch_stiffness, travel_time
from pgfmd.schemes.gfmd.plugin import inertia_of_scene
from scripts.studies.forecast.scenes import CASES, FIT, JUDGE
from scripts.studies.forecast.table import TABLE, rows_of

EARLY = 'output.snapshots=["0.5 t_pl"]'


@pytest.fixture(scope="module")
def counted():
    """(row, scene) of the table of counted runs."""
    return [(row, load_scene(row.scene, row.changes.split("; "))) for row in rows_of(TABLE)]


@pytest.fixture(scope="module")
def told(counted):
    """(row, effort) of the same."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(effort_module, "pair_seconds", lambda scene: 1e-3)
        return [(row, effort_of(scene)) for row, scene in counted]


@pytest.fixture(autouse=True)
def untimed(monkeypatch):
    """Nothing here depends on how fast this machine is."""
    monkeypatch.setattr(effort_module, "pair_seconds", lambda scene: 1e-3)


# -- steps and pairs ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", [FIT, JUDGE])
def test_nine_of_ten_scenes_are_told_within_a_factor_of_one_and_a_half(told, part):
    ratios = np.array([effort.pairs / row.pairs for row, effort in told if row.part == part])
    assert ratios.size > 70
    assert np.mean(np.abs(np.log(ratios)) < math.log(1.5)) > 0.9
    assert 0.9 < np.median(ratios) < 1.1


def test_the_spread_that_is_told_holds_nineteen_of_twenty_scenes(told):
    within = [1.0 / effort.spread <= effort.pairs / row.pairs <= effort.spread for row, effort in told]
    assert np.mean(within) >= 0.95


def test_the_table_has_every_kind_and_only_scenes_of_the_list(counted):
    kinds = {kind_of(scene) for _, scene in counted if scene.solver.scheme != "gfmd"}
    assert kinds == set(FITTED)
    names = {(case.scene, "; ".join(case.changes)) for case in CASES}
    assert {(row.scene, row.changes) for row, _ in counted} <= names


@pytest.mark.parametrize("name", ["tri-tack", "hex-tack", "flat-punch"])
def test_a_faster_punch_takes_no_more_pairs_and_nothing_jumps(name):
    speeds = np.geomspace(0.1, 1e6, 30)
    pairs = np.array([effort_of(load_scene(name, [f"drive.speed={speed!r} um/s"])).pairs for speed in speeds.tolist()])
    ratios = pairs[1:] / pairs[:-1]
    # A step of three quarters in speed: pairs fall by less than in proportion, and hardly rise.
    assert ratios.max() < 1.03 and ratios.min() > 1.0 / 1.8


def test_a_finer_accuracy_costs_more_in_steps_and_pairs():
    coarse, fine = (effort_of(load_scene("hex-tack", [f"solver.accuracy={value}"])) for value in (1e-2, 1e-3))
    assert fine.steps > 2.0 * coarse.steps and fine.pairs > coarse.pairs


def test_many_elements_cost_as_one_in_the_middle_of_their_spectrum():
    alike = [
        "rheology.model=geometric", "rheology.elements=20", "rheology.time_ratio=1.0001", "rheology.exponent=0",
        "rheology.relaxation_time=400 us", "rheology.modulus_ratio=250",
    ]  # fmt: skip
    one, many = effort_of(load_scene("tri-tack")), effort_of(load_scene("tri-tack", alike))
    assert many.pairs == pytest.approx(one.pairs, rel=0.05)


def test_the_kind_follows_from_what_jumps():
    scene = load_scene("tri-tack", ["solver.scheme=quasistatic", "solver.modulus=instantaneous", "grid.n=64"])
    assert jump_threshold(scene) < 250 and kind_of(scene) == "smooth"
    assert (
        kind_of(load_scene("tri-tack", ["solver.scheme=quasistatic", "solver.modulus=instantaneous", "grid.n=1024"]))
        == "quasi-static"
    )
    assert kind_of(load_scene("flat-punch", ["rheology.model=elastic"])) == "flat, elastic"
    assert kind_of(load_scene("hertz")) == "repulsive"


def test_steps_and_pairs_are_those_of_the_formula():
    """By hand, for a way in."""
    scene = load_scene("tri-tack")
    way, numbers = strokes_of(scene)[0], FITTED["viscoelastic"]
    creep_time = 400e-6 * 250
    slow = 0.05 / (scene.substrate.contact_modulus * 1e-6 * creep_time)
    steps = numbers.least[0] + numbers.rate[0] * way.length**numbers.travel * slow**numbers.slow
    softness = 1 / 250 + (1 - 1 / 250) * -math.expm1(-way.time / steps / creep_time)
    hardness = math.pi**2 * 0.05 / (2 * scene.adhesion.range**2) * 75e-6 / scene.substrate.contact_modulus
    each = numbers.pairs_least + numbers.pairs_rate[0] * math.sqrt(1 + softness * hardness**numbers.stiff)
    assert counts_of(way, numbers) == pytest.approx((steps, steps * each), rel=1e-9)


def test_check_tells_a_number_or_a_range():
    known = check.report(load_scene("tri-tack"))
    assert isinstance(known["expected transform pairs"], int) and "within a factor of" in str(known.sections["Cost"])
    unknown = check.report(load_scene("tri-tack", ["drive.dwell=1 s"]))
    low, _, high = unknown["expected transform pairs"].partition(" to ")
    assert 2.0 < int(high) / int(low) < 16.0 and "scenes with a dwell" in str(unknown.sections["Cost"])
    assert " to " in unknown["expected time on 1 rank"]


# -- ways of the punch -------------------------------------------------------------------------------------------------


def test_depths_at_the_preload_are_those_of_runs(counted):
    """Counted with the range of adhesion, within which a depth is not sharp."""
    ratios = np.array([
        (depth_at_preload(scene) + scene.adhesion.range) / (row.depth + scene.adhesion.range)
        for row, scene in counted if scene.solver.scheme == "inertialess"
    ])  # fmt: skip
    assert np.mean(np.abs(ratios - 1.0) < 0.2) > 0.85 and 0.9 < np.median(ratios) < 1.1


@pytest.mark.parametrize("stiffness", ["100 N/m", "10 N/m"])
def test_explicit_steps_follow_the_end_of_the_spring(stiffness):
    """It goes as far as the punch, and as far as preload and pull-off press and pull the spring."""
    base = ["solver.scheme=gfmd", "punch.pattern=sphere", "punch.curvature_radius=1 mm"]
    rigid, sprung = (load_scene("tri-tack", [*base, *more]) for more in ([], [f"drive.machine_stiffness={stiffness}"]))
    step, drive = inertia_of_scene(rigid).step, rigid.drive
    # JKR: the sphere comes off at 1.5 pi gamma R.
    forces = 2.0 * drive.preload + 1.5 * math.pi * 0.05 * 1e-3
    ways = forces / float(stiffness.split()[0]) + sum(travel.length for travel in travels_of(sprung))
    told = effort_of(sprung)
    assert told.steps == pytest.approx((ways / drive.speed + drive.turn_time) / step, rel=1e-9)
    assert told.spread == UNLIKE * effort_of(rigid).spread and "a spring" in told.unlike


def test_the_speed_of_a_punch_on_a_spring_is_its_own():
    rigid, sprung = (load_scene("tri-tack", more) for more in ([], ["drive.machine_stiffness=1 kN/m"]))
    assert punch_speeds(rigid) == (rigid.drive.speed, rigid.drive.retract_speed)
    (into, _), (soft, _) = strokes_of(rigid), strokes_of(sprung)
    way = depth_at_preload(sprung) + sprung.drive.clearance
    assert soft.time == pytest.approx((way + 40e-6) / 1e-6, rel=1e-9)
    assert soft.slow / into.slow == pytest.approx(1.0 + 40e-6 / way, rel=1e-9)
    found = check.report(sprung)["time to move by rho"]
    assert found == pytest.approx(sprung.adhesion.range / 1e-6 * (1.0 + 40e-6 / way), rel=1e-9)


def test_under_a_controlled_force_the_whole_punch_in_contact_has_the_speed_of_the_scene():
    """Of a flat punch on a half-space F = 2aE* d, so the machine's way is (1 + 1/SOFT_MACHINE) d."""
    scene = load_scene("flat-punch", ["drive.control=load"])
    way = scene.drive.preload / punch_stiffness(scene)
    assert travel_time(scene, way, scene.drive.preload) == pytest.approx(way / scene.drive.speed, rel=1e-9)
    assert travel_time(scene, way, 0.0) < 2.0 * SOFT_MACHINE * way / scene.drive.speed


def test_images_take_off_what_their_green_function_says():
    """Against the sum over a periodic cell less the integral over the plane, of a uniform pressure on a disc."""
    from scipy.special import j1

    length, radius, modulus = 1.0, 0.15, 1.0
    compliance, most = HalfSpace(modulus), 700
    index = 2.0 * math.pi / length * np.arange(-most, most + 1)
    qx, qy = np.meshgrid(index, index)
    q = np.hypot(qx, qy)
    inside = (q > 0.0) & (q <= index[-1])
    shape = (2.0 * j1(q[inside] * radius) / (q[inside] * radius)) ** 2
    periodic = float((compliance(qx[inside], qy[inside]) * shape).sum()) / length**2
    # The same disc alone, up to the same wave number: its mean displacement, for a force of one.
    fine = np.linspace(0.0, index[-1], 400_001)
    shape = (2.0 * j1(fine[1:] * radius) / (fine[1:] * radius)) ** 2
    alone = float(np.trapezoid(np.append(1.0, shape) * 2.0 / modulus, fine)) / (2.0 * math.pi)
    # For two points of a disc under uniform pressure, the mean square distance is a^2.
    told = (-MADELUNG / length + SECOND * radius**2 / length**3) / (math.pi * modulus)
    assert periodic - alone == pytest.approx(told, rel=1e-3)


def test_images_share_of_the_shipped_cell():
    assert images_share(load_scene("tri-tack")) == pytest.approx(0.41, abs=0.01)
    assert images_share(load_scene("flat-punch")) == 1.0


# -- what is run ahead -------------------------------------------------------------------------------------------------


def test_nothing_is_run_ahead_without_early_snapshots():
    scene = load_scene("tri-tack")
    assert coarse_scenes(scene) == [] and ahead_summary(scene) == ("", "")


@pytest.mark.parametrize(
    ("changes", "grids", "ranges"),
    [
        (["grid.n=2048"], [512, 512], [2.0, 2.0 * math.sqrt(2.0)]),
        (["grid.n=512"], [256, 256], [math.sqrt(2.0), 2.0]),
        (["grid.n=256"], [256], [1.0]),
        (["grid.n=2048", "punch.wavelength=20 um"], [1024, 1024], [math.sqrt(2.0), 2.0]),
        (["grid.n=2048", "adhesion.range=3 um"], [512], [1.0]),
        (["grid.n=2048", "adhesion.law=repulsive"], [512], [1.0]),
        (["grid.n=512", "substrate.thickness=0.8 um", "substrate.boundary=free"], None, None),
    ],
)
def test_coarse_approaches_are_on_a_grid_that_carries_the_scene(changes, grids, ranges):
    scene = load_scene("hex-tack", changes)
    found = coarse_scenes(scene)
    if grids is None:
        # Of so thin a film the coarse grid's kernel is refused: one that is fine enough is taken.
        assert found[0].grid.n > 256
        return
    assert [one.grid.n for one in found] == grids
    assert [one.adhesion.range / scene.adhesion.range for one in found] == pytest.approx(ranges)
    # Each starts as far out of reach as the scene.
    away = scene.drive.clearance - (scene.adhesion.range if scene.adhesion.law == "cosine" else 0.0)
    for one in found:
        assert one.drive.clearance - (one.adhesion.range if one.adhesion.law == "cosine" else 0.0) == pytest.approx(
            away
        )
        assert not one.output.energy and not one.output.snapshots


def test_places_in_proportion_to_the_range_are_found_exactly():
    scene = load_scene("hex-tack", ["grid.n=2048"])
    rho = scene.adhesion.range

    def place(reach):
        return Met(reach, 0.7 * reach, -3e-6 - 1.1 * reach)

    found = met_by(scene, [place(2.0 * rho), place(2.9 * rho)])
    assert (found.contact, found.preload) == pytest.approx((0.7 * rho, -3e-6 - 1.1 * rho), rel=1e-12)
    ((time, label),) = moments(scene, found)
    middle = 0.5 * (found.contact + found.preload)
    assert label == "0.5 t_pl" and time == pytest.approx((scene.drive.clearance - middle) / 1e-6, rel=1e-12)


def test_coarse_approaches_foretell_the_moments_and_say_so():
    scene = load_scene("tri-tack", ["grid.n=512", "drive.speed=25 um/s", EARLY])
    said = []
    ((time, _),) = run_ahead(scene, MPI.COMM_SELF, said.append)
    simulation = assemble(scene, MPI.COMM_SELF)
    simulation.run(only_to_preload=True)
    own = met(simulation)
    share = (scene.drive.clearance - 25e-6 * time - own.contact) / (own.preload - own.contact)
    assert share == pytest.approx(0.5, abs=0.015)
    assert said[0].startswith(
        "run ahead to place the snapshots before the preload: about 2 coarse approaches, n = 256, "
    )
    assert "0.5 t_pl at t = " in said[-1] and any(line.startswith("ahead: ") for line in said)


def test_an_early_snapshot_counts_in_the_forecast():
    scene = load_scene("hex-tack", ["grid.n=1024"])
    what, share = ahead_summary(scene)
    assert "n = 256" in what and 0.1 < float(share.split()[0]) < 5.0
    assert check.report(scene)["run ahead"] == what
