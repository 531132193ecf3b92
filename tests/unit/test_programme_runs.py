"""Programmes of steps as runs do them: ends, loads, cycles, snapshots, restarts."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

import pgfmd
import pgfmd.runner
from pgfmd.errors import SceneError, Stopped
from pgfmd.in_memory import simulate
from pgfmd.output.regular_snapshots import RegularSnapshots
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.results import load
from pgfmd.results.status import status_of
from pgfmd.runner import Options, run_scene
from pgfmd.scene.output_section import Rhythm
from tests.stopper import StopAfter

BASE = {
    "punch": {"pattern": "flat", "radius": "375 um"},
    "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
    "rheology": {"model": "single", "modulus_ratio": 10, "relaxation_time": "20 ms"},
    "adhesion": {"law": "cosine", "work_of_adhesion": "50 mJ/m^2"},
    "grid": {"n": 20, "length": "1.5 mm"},
    "output": {"patches": False},
}
APPROACH = {"do": "approach", "speed": "20 um/s", "until": "2 mN"}
RETRACT = {"do": "retract", "speed": "20 um/s", "until": "free"}
CREEP = {"do": "hold", "of": "load", "for": "20 ms"}
SWING = {"do": "oscillate", "amplitude": "10 nm", "frequency": "50 Hz", "cycles": 0.5}


def scene(steps=(), drive=None, **sections):
    together = {name: BASE.get(name, {}) | sections.get(name, {}) for name in {*BASE, *sections}}
    return pgfmd.Scene(together, drive=(drive or {}) | ({"step": list(steps)} if steps else {}))


def ends_of(run):
    """Displacement [m], force [N] and contact area [m^2] at the end of each step, by its number; of the last cycle."""
    curve = run.curve
    return {
        stage: tuple(curve[name][k] for name in ("displacement [m]", "force [N]", "contact_area [m^2]", "time [s]"))
        for k, stage in enumerate(curve["stage"])
    }


# Ends ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", [{}, {"scheme": "quasistatic"}])
def test_the_short_form_is_its_three_steps_to_the_last_bit(solver):
    for dwell in ({"dwell": "20 ms"}, {}) if not solver else ({},):
        short = simulate(scene(drive={"speed": "20 um/s", "preload": "2 mN"} | dwell, solver=solver))
        hold = [{"do": "hold", "for": dwell["dwell"]}] if dwell else []
        long = simulate(scene([APPROACH, *hold, RETRACT], solver=solver))
        assert len(short.curve) == len(long.curve) > 25
        for name in short.curve:
            assert np.array_equal(short.curve[name], long.curve[name]), name
        assert short.run["work_of_separation_J"] == long.run["work_of_separation_J"] > 0.0


def test_a_step_ends_with_the_first_of_its_ends():
    run = simulate(
        scene(
            [
                {"do": "approach", "speed": "20 um/s", "until": ["0.25 mm^2", "4 mN"]},
                {"do": "approach", "speed": "20 um/s", "until": ["2 um", "90 mN"]},
                {"do": "retract", "speed": "20 um/s", "to": "0.5 um"},
                {"do": "hold", "of": "load", "until": "10 ms"},
                {"do": "hold", "until": ["30 ms", "10 mN"]},
                {"do": "retract", "speed": "20 um/s", "until": ["-8 mN", "free"]},
                {"do": "approach", "speed": "20 um/s", "duration": "5 ms"},
                {"do": "retract", "speed": "20 um/s", "to": "12 um"},
                {"do": "hold", "for": "5 ms"},
            ]
        )
    )
    ends, curve = ends_of(run), run.curve
    cell = (1.5e-3 / 20) ** 2
    assert ends[1][2] >= 0.25e-6 - cell and ends[1][1] < 4e-3
    start = max(k for k, stage in enumerate(curve["stage"]) if stage == 1)
    travelled = curve["displacement [m]"][start] - ends[2][0]
    assert travelled == pytest.approx(2e-6, abs=1e-9)
    assert ends[3][0] == pytest.approx(0.5e-6, abs=1e-9)
    rows = {name: [k for k, phase in enumerate(curve["phase"]) if phase == name] for name in ("hold", "dwell")}
    time = np.asarray(curve["time [s]"])
    assert time[rows["hold"][-1]] - time[rows["hold"][0] - 1] == pytest.approx(10e-3, rel=1e-12)
    dwells = [k for k in rows["dwell"] if curve["stage"][k] == 5]
    assert time[dwells[-1]] - time[dwells[0] - 1] == pytest.approx(30e-3, rel=1e-12)
    assert ends[6][1] == pytest.approx(-8e-3, rel=2e-4)
    # Beyond the reach of adhesion a step goes on to its place, and the next one does not end with it.
    assert ends[8][0] == pytest.approx(12e-6, abs=1e-9) and ends[9][0] > 12e-6
    assert run.run["finished"] == "completed"
    events = list(run.events["event"])
    # Each time that the punch stops pressing is a preload, whatever ends the step.
    assert (events[-1], events.count("step end"), events.count("preload")) == ("completed", 7, 2)


def test_a_load_is_held_and_ramped():
    creep, ramp = {"do": "hold", "of": "load", "for": "60 ms"}, {"do": "ramp", "rate": "50 mN/s", "until": "4 mN"}
    seen = []
    run = simulate(
        scene([APPROACH, creep, ramp, {"do": "ramp", "rate": "-50 mN/s", "until": "free"}]),
        each=lambda step: seen.append((step.cycle, step.stage, step.phase, step.force)),
    )
    assert [key[:3] for key in seen] == list(
        zip(run.curve["cycle"], run.curve["stage"], run.curve["phase"], strict=True)
    )
    held = [key[3] for key in seen if key[2] == "hold"]
    assert held == pytest.approx([2e-3] * len(held), rel=3e-4)
    ends = ends_of(run)
    # The contact of a viscoelastic body creeps: J grows from 0.1 to 1.
    assert ends[2][0] < ends[1][0] - 0.2e-6
    assert ends[3][1] == pytest.approx(4e-3, rel=2e-4)
    # A load that pulls more than the contact bears tears the punch off.
    assert run.run["finished"] == "detached" and run.run["pull_off_force_N"] > 10e-3


def test_a_torn_off_punch_is_not_flung_away_by_the_load_that_it_should_hold():
    pull = {"do": "ramp", "rate": "-1 N/s", "until": "-30 mN"}
    run = simulate(scene([APPROACH, pull, CREEP, APPROACH | {"until": "1 mN"}, RETRACT]))
    assert 3 not in set(run.curve["stage"]) and max(run.curve["displacement [m]"]) < 10e-6
    assert ends_of(run)[4][1] == pytest.approx(1e-3, rel=2e-4)


def test_cycles_of_an_elastic_body_are_equal_without_time():
    ramp = {"do": "ramp", "rate": "10 mN/s", "until": "3 mN"}
    steps = [APPROACH, ramp, CREEP, RETRACT]
    run = simulate(scene(steps, {"repeat": {"times": 2}}, solver={"scheme": "quasistatic"}))
    first, second = run.run["cycles"]
    assert set(run.curve["stage"]) == {1, 2, 4}, "nothing is held without time"
    for key in ("preload_N", "largest_force_N", "pull_off_force_N", "snap_in_force_N"):
        assert second[key] == pytest.approx(first[key], rel=1e-2), key
    assert second["work_J"] == pytest.approx(first["work_J"], rel=2e-2)
    assert (first["preload_N"], run.run["preload_N"]) == pytest.approx((3e-3, 3e-3), rel=2e-4)
    assert ends_of(run)[2][1] == pytest.approx(3e-3, rel=2e-4)


def test_explicit_steps_do_programmes_too():
    steps = [APPROACH | {"speed": "1 mm/s"}, CREEP | {"for": "2 ms"}, RETRACT | {"speed": "1 mm/s"}]
    run = simulate(scene(steps, rheology={"relaxation_time": "1 ms"}, solver={"scheme": "gfmd"}))
    force = np.asarray(run.curve["force [N]"])[np.asarray(run.curve["phase"]) == "hold"]
    assert force == pytest.approx(force[0], rel=3e-4) and force[0] == pytest.approx(2e-3, rel=5e-3)
    assert run.run["finished"] == "detached" and ends_of(run)[2][0] < ends_of(run)[1][0]


# Cycles, snapshots, status ------------------------------------------------------------------------------------------

CYCLES = [APPROACH, CREEP, SWING, RETRACT]
REPEAT = {"repeat": {"times": 2}}


def into(folder, of, stop_after=math.inf, **options):
    """Runs a scene into a folder, until it is finished or has made so many steps; returns the folder."""
    before, pgfmd.runner.StopSignals = pgfmd.runner.StopSignals, StopAfter
    StopAfter.steps = stop_after
    try:
        run_scene(of, MPI.COMM_SELF, folder, lambda line: None, Options(**options))
    except Stopped:
        pass
    finally:
        pgfmd.runner.StopSignals = before
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return into(tmp_path_factory.mktemp("whole") / "out", scene(CYCLES, REPEAT, output=SNAPSHOTS))


SNAPSHOTS = {"snapshots": ["every 2 um", "every 4 mN", "every 0.1 s", "step ends"]}


def test_each_cycle_has_its_numbers(whole):
    results = load(whole)
    curve, cycles = results.curve, results.run["cycles"]
    assert [entry["cycle"] for entry in cycles] == [1, 2]
    for entry in cycles:
        rows = curve[curve["cycle"] == entry["cycle"]]
        assert entry["largest_force_N"] == rows["force [N]"].max()
        out = rows[rows["phase"] == "retract"]
        assert entry["pull_off_force_N"] >= -out["force [N]"].min() > 5e-3
        assert entry["preload_N"] == pytest.approx(2e-3, rel=2e-4)
        assert entry["end_s"] == rows["time [s]"].iloc[-1]
    total = sum(entry["work_J"] for entry in cycles)
    assert total == pytest.approx(results.run["work_J"], rel=1e-12)
    assert [a["end_s"] for a in cycles[:-1]] == [b["start_s"] for b in cycles[1:]]


def test_snapshots_come_at_equal_distances_and_at_the_ends_of_steps(whole):
    results = load(whole)
    labels, times = list(results.labels), np.asarray(results.fields["time"])
    curve = results.curve
    time, place, force = (np.asarray(curve[name]) for name in ("time [s]", "displacement [m]", "force [N]"))
    found = {"t": [], "d": [], "F": []}
    for label, when in zip(labels, times, strict=True):
        (row,) = np.flatnonzero(time == when)
        if label[:2] in ("t ", "d ", "F "):
            found[label[0]].append({"t": time, "d": place, "F": force}[label[0]][row])
    assert found["t"] == pytest.approx(0.1 * np.arange(1, int(time[-1] / 0.1) + 1), rel=1e-9)
    # One at each multiple that the punch passes: on the way in, and out, of each cycle.
    for values, path, size in ((found["d"], place, 2e-6), (found["F"], force, 4e-3)):
        passed = sum(
            abs(math.floor(a / size) - math.floor(b / size)) for a, b in itertools.pairwise(path) if abs(a - b) < size
        )
        assert 4 <= len(values) <= passed
        near = [abs(value / size - round(value / size)) for value in values]
        assert np.median(near) < 0.02
    ends = [label for label in labels if label.startswith("end of step")]
    assert ends[:3] == ["end of step 2, cycle 1", "end of step 3, cycle 1", "end of step 4, cycle 1"]
    assert "end of step 1, cycle 2" in ends and labels.count("preload") == 1


@pytest.mark.parametrize(("size", "start", "path", "labels"), [
    (1e-6, 2.2e-6, (2.1e-6, 2.0e-6, 1.5e-6, 1.01e-6, 0.2e-6, -1.3e-6), ("2 um", "1 um", "-1.3 um")),
    (1e-6, 0.0, (0.5e-6, 0.2e-6, -0.4e-6, -1e-6, -0.5e-6, 0.0), ("-1 um", "0 m")),
])  # fmt: skip
def test_a_multiple_counts_once_until_another_is_reached(size, start, path, labels):
    state = SimpleNamespace(punch_displacement=start, preload_time=None)
    snapshots = RegularSnapshots.of([Rhythm("displacement", size), Rhythm("step ends", 0.0)], state)
    found = []
    for place in path:
        state.punch_displacement = place
        found += snapshots.take(state)
    assert found == [f"d = {label}" for label in labels] and snapshots.step_ends


def test_a_stopped_programme_says_where_it_is_and_goes_on_to_the_same_bits(whole, tmp_path):
    curve, of = load(whole).curve, scene(CYCLES, REPEAT, output=SNAPSHOTS)
    swinging = next(k for k, phase in enumerate(curve["phase"]) if phase == "oscillate" and curve["cycle"][k] == 2)
    out = into(tmp_path / "out", of, stop_after=swinging + 5)
    status = status_of(out)
    assert (status.stage, status.stages, status.cycle, status.cycles) == (3, 4, 2, 2)
    assert 0.5 < status.progress < 0.9
    # In the middle of a held load, and of a retraction, as well.
    for steps in (len(curve) // 3, 10):
        into(out, of, stop_after=steps)
    assert differences(into(out, of), whole) == []


def test_steps_to_come_change_and_the_run_is_that_of_the_new_programme(tmp_path):
    old, new = scene(CYCLES, REPEAT), scene([*CYCLES[:2], SWING | {"cycles": 1}, RETRACT], {"repeat": {"times": 1}})
    out = into(tmp_path / "out", old, stop_after=12)
    with pytest.raises(SceneError, match=r"add --allow drive\.step"):
        into(out, new)
    changed = into(out, new, allow=("drive.step", "drive.repeat"))
    expected = into(tmp_path / "new", new)
    assert "curve.csv" not in differences(changed, expected) and "events.csv" not in differences(changed, expected)
    begun = scene([APPROACH | {"speed": "30 um/s"}, *CYCLES[1:]], REPEAT)
    stopped = into(tmp_path / "again", old, stop_after=12)
    with pytest.raises(SceneError, match="the approach has begun"):
        into(stopped, begun, allow=("drive",))
