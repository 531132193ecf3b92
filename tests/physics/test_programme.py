"""Programmes of steps: against the exact solution of a column, the complex modulus of a flat punch in full contact, periodic
solutions, quasi-static pull-off, and energies that add up in every scheme."""

import math

import numpy as np
import pytest

import pgfmd
from pgfmd import scene_objects
from pgfmd.analysis.programme import stiffness_of
from pgfmd.solver.simulation import Observer
from tests.physics.column import column, errors
from tests.physics.runs import CONTACT_MODULUS, RADIUS

TIMED = (
    {"do": "approach", "speed": "100 um/s", "for": "20 ms"},
    {"do": "hold", "of": "load", "for": "20 ms"},
    {"do": "ramp", "rate": "5 N/s", "for": "10 ms"},
    {"do": "hold", "for": "10 ms"},
)
SWINGS = (
    {"do": "oscillate", "amplitude": "50 nm", "frequency": "50 Hz", "cycles": 1},
    {"do": "oscillate", "amplitude": "20 mN", "frequency": "50 Hz", "cycles": 0.5},
    {"do": "retract", "speed": "100 um/s", "for": "2 ms"},
)
"""Steps that end at given times, so that the only error is that of the time steps."""


@pytest.mark.parametrize("elements", [0, 1, 5])
def test_every_kind_of_step_is_that_of_the_exact_solution_with_a_spring(elements):
    found = errors(column(elements, step=[*TIMED, *SWINGS], preload="0.3 N", machine_stiffness="100 kN/m"))
    assert max(map(abs, found.late)) < 1e-12
    assert found.force < (1e-9 if elements == 0 else 5e-4) and found.place < (1e-12 if elements == 0 else 1e-9)


@pytest.mark.parametrize(("elements", "machine"), [(1, {}), (1, {"machine_stiffness": "100 kN/m"}), (5, {})])
def test_steps_of_displacement_and_load_are_of_second_order_in_time(elements, machine):
    """Errors fall at least with the square of the number of steps, which are unequal, so that no power is exact."""
    coarse, fine = (
        errors(column(elements, accuracy, step=list(TIMED), preload="0.3 N", **machine)) for accuracy in (8e-3, 1.25e-4)
    )
    more = fine.steps / coarse.steps
    assert 2.0 < more < 3.5
    assert fine.force < coarse.force / more**1.8 and fine.place < coarse.place / more**1.6


def test_a_fine_run_on_a_soft_spring_is_not_held_up_by_the_error_of_its_forces():
    """The audit asked for less than solves leave, and for steps of 1e-23 s."""
    found = errors(column(5, 1.25e-4, step=list(TIMED), preload="0.3 N", machine_stiffness="5 kN/m"))
    assert found.force < 1e-5 and found.steps < 150


def test_ends_by_force_travel_and_place_are_met_when_the_exact_solution_has_them():
    steps = [
        {"do": "approach", "speed": "100 um/s", "until": "0.3 N"},
        {"do": "hold", "of": "load", "until": "0.5 um"},
        {"do": "ramp", "rate": "-5 N/s", "until": "0.2 N"},
        {"do": "hold", "of": "load", "until": ["1 um", "20 ms"]},
        {"do": "retract", "speed": "100 um/s", "until": "0.3 um"},
        {"do": "approach", "speed": "50 um/s", "to": "-5 um", "until": "1 N"},
        {"do": "hold", "until": "0.25 N"},
    ]  # fmt: skip
    found = errors(column(1, 2e-3, step=steps, machine_stiffness="100 kN/m"))
    # Forces are met to 1e-4 of themselves; the load, which creeps, relaxes by 0.4 of itself in 10 ms.
    assert found.force < 1e-3 and found.place < 5e-9
    assert max(map(abs, found.late)) < 1e-4


def test_a_held_load_and_a_ramp_have_the_values_of_the_scene_while_the_punch_creeps():
    """The soft spring that stands for a load gives way by its share of 1e-4."""
    curve = pgfmd.simulate(column(5, step=list(TIMED), preload="0.3 N")).curve
    time, force, stage = (curve[name].to_numpy() for name in ("time [s]", "force [N]", "stage"))
    held, ramped = stage == 2, (stage == 3) & (curve["phase"] == "ramp")
    before = force[stage == 1][-1]
    assert np.ptp(force[held]) < 2e-4 * before and abs(force[held][-1] / before - 1.0) < 2e-4
    assert np.polyfit(time[ramped], force[ramped], 1)[0] == pytest.approx(5.0, rel=1e-3)
    assert np.ptp(curve["displacement [m]"].to_numpy()[held]) > 1e-7


FREQUENCIES = tuple(x / (2 * math.pi * 10e-3) for x in (0.1, 1.0, 10.0))
"""Over two decades around 1/tau [Hz]."""


def flat(n, steps, **drive):
    """A flat punch on a free half-space in full contact, with overlaps that hardly give way."""
    return pgfmd.Scene(
        {
            "punch": {"pattern": "flat", "radius": f"{RADIUS} m"},
            "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495, "boundary": "free"},
            "rheology": {"model": "single", "modulus_ratio": 20.0, "relaxation_time": "10 ms"},
            "adhesion": {"law": "repulsive", "work_of_adhesion": "50 mJ/m^2", "range_factor": 64.0},
            "drive": {
                "clearance": "0 m",
                "step": [
                    {"do": "ramp", "rate": "0.5 N/s", "until": "10 mN"}, {"do": "hold", "of": "load", "for": "2 s"},
                    *steps,
                ],
                **drive,
            },
            "grid": {"n": n, "length": f"{4 * RADIUS} m"},
            "solver": {"accuracy": 3e-3},
        }
    )  # fmt: skip


def stiffnesses(scene):
    """K [N/m] of the last full cycle of each oscillation, and its frequency [Hz]."""
    curve = pgfmd.simulate(scene).curve
    time, place, force, stage = (
        curve[name].to_numpy() for name in ("time [s]", "displacement [m]", "force [N]", "stage")
    )
    for number, step in enumerate(scene.drive.step, 1):
        if step.do == "oscillate":
            mine = (stage == number) & (curve["phase"] == "oscillate").to_numpy()
            end = time[mine][-1] - 1.0 / step.frequency
            last = mine & (time <= end * (1 + 1e-12)) & (time >= end - (1 + 1e-9) / step.frequency)
            yield step.frequency, stiffness_of(time[last], place[last], force[last], step.frequency)[0]


def of_points(scene, frequency):
    """K [N/m] of the points of the grid: of J* G, in series with the overlaps, by dense matrices."""
    n, spacing = scene.grid.n, scene.grid.length / scene.grid.n
    position = (np.arange(n) + 0.5) * spacing - 0.5 * scene.grid.length
    y, x = (values.ravel() for values in np.meshgrid(position, position, indexing="ij"))
    inside = np.hypot(x, y) <= RADIUS * (1 + 1e-12)
    x, y = x[inside], y[inside]
    kernel = scene_objects.free_compliance_of(scene).kernel
    matrix = kernel(x[:, None] - x[None, :], y[:, None] - y[None, :], spacing)
    series, law = scene_objects.series_of(scene.rheology), scene_objects.law_of(scene.adhesion)
    kappa = complex(series.kappa_of(2 * math.pi * frequency))
    whole = matrix / kappa + np.eye(x.size) / law.overlap_stiffness
    return spacing**2 * np.linalg.solve(whole, np.ones(x.size)).sum()


def test_storage_and_loss_of_a_flat_punch_are_those_of_its_complex_modulus():
    """2 a E*(omega), but for the outline on the grid and the overlaps in series; with these to 1e-3."""
    steps = [
        {"do": "oscillate", "amplitude": amplitude, "frequency": f"{frequency} Hz", "cycles": 2}
        for frequency in FREQUENCIES
        for amplitude in ("100 nm", "1 mN")
    ]
    off = []
    for n in (16, 32):
        scene = flat(n, steps if n == 16 else steps[2:4])
        series = scene_objects.series_of(scene.rheology)
        found = list(stiffnesses(scene))
        errors = [abs(stiffness / of_points(scene, frequency) - 1.0) for frequency, stiffness in found]
        # Of the first by its time steps, see below: they are as long as the relaxation time.
        assert max(errors[1 if n == 16 else 0 :]) < 1e-3 and errors[0] < 4e-3
        ideal = [2 * RADIUS * CONTACT_MODULUS * series.kappa_of(2 * math.pi * frequency) for frequency, _ in found]
        off.append(max(abs(k / i - 1.0) for (_, k), i in zip(found, ideal, strict=True)))
    assert off[0] < 0.03 and off[1] < 0.006


def test_storage_and_loss_get_better_with_the_steps_in_a_cycle(monkeypatch):
    step = {"do": "oscillate", "amplitude": "100 nm", "frequency": f"{FREQUENCIES[0]} Hz", "cycles": 2}
    scene, errors = flat(8, [step]), []
    for points in (64, 128):
        monkeypatch.setattr("pgfmd.physics.programme.POINTS_A_CYCLE", points)
        ((frequency, stiffness),) = stiffnesses(scene)
        errors.append(abs(stiffness / of_points(scene, frequency) - 1.0))
    assert errors[1] < 0.4 * errors[0] < 1.4e-3


def test_a_spring_does_not_change_the_stiffness_of_the_contact():
    step = {"do": "oscillate", "amplitude": "500 nm", "frequency": f"{FREQUENCIES[1]} Hz", "cycles": 2}
    scene = flat(16, [step], machine_stiffness="5 kN/m")
    ((frequency, stiffness),) = stiffnesses(scene)
    assert abs(stiffness / of_points(scene, frequency) - 1.0) < 3e-3


def cycled(scene):
    """A run, and the work [J], the pull-off force [N] and the largest force [N] of its cycles, (cycles, 3)."""
    found = pgfmd.simulate(scene)
    names = "work_J", "pull_off_force_N", "largest_force_N"
    return found, np.array([[cycle[name] for name in names] for cycle in found.run["cycles"]])


def test_ten_cycles_of_an_elastic_punch_are_ten_equal_ones():
    """As equal as the tolerance of the solves lets them be: also the energy that jumps release."""
    scene = pgfmd.Scene(
        "tri-tack", grid={"n": 20}, rheology={"model": "elastic", "modulus_ratio": None, "relaxation_time": None},
        solver={"accuracy": 0.01},
        drive={
            "step": [
                {"do": "approach", "speed": "20 um/s", "until": "3 mN"}, {"do": "retract", "speed": "20 um/s", "until": "free"},
            ],
            "repeat": {"times": 10}, "speed": None, "preload": None,
        },
    )  # fmt: skip
    _, numbers = cycled(scene)
    assert len(numbers) == 10
    # What jumps release depends on where in a step they are.
    np.testing.assert_allclose(numbers, np.broadcast_to(numbers[-1], (10, 3)), rtol=0.01)
    np.testing.assert_allclose(numbers[3:], np.broadcast_to(numbers[-1], (7, 3)), rtol=1e-5)
    np.testing.assert_allclose(numbers[:, 1:], np.broadcast_to(numbers[-1, 1:], (10, 2)), rtol=1e-3)


def test_cycles_of_a_viscoelastic_column_tend_to_the_periodic_ones():
    """The harmonics of the way, each by the complex modulus of its frequency."""
    steps = [
        {"do": "approach", "speed": "100 um/s", "for": "100 ms", "turn_time": "2 ms"},
        {"do": "approach", "speed": "100 um/s", "for": "20 ms", "turn_time": "2 ms"},
        {"do": "retract", "speed": "100 um/s", "for": "20 ms", "turn_time": "2 ms"},
    ]
    scene = column(1, 1e-3, step=steps, preload="0.3 N", repeat={"times": 10, "first": 2})
    found, numbers = cycled(scene)
    curve = found.curve
    last = (curve["cycle"] == 10).to_numpy()
    time, force = (curve[name].to_numpy()[last] for name in ("time [s]", "force [N]"))
    phases = [phase for phase in scene_objects.drive_of(scene).phases if phase.cycle == 9]
    ends = np.cumsum([0.0, *(phase.duration for phase in phases)])
    period, count = float(ends[-1]), 4096
    way, start, at = np.empty(count), 0.0, np.arange(count) * period / count
    for phase, begin, end in zip(phases, ends[:-1], ends[1:], strict=True):
        within = (at >= begin) & (at < end)
        way[within] = [start + phase.displacement(t - begin) for t in at[within]]
        start += phase.displacement(end - begin)
    begun = curve["time [s]"].to_numpy()[~last][-1]
    depth = float(scene_objects.compliance_of(scene)(np.zeros(1), np.zeros(1))[0])
    series, law = scene_objects.series_of(scene.rheology), scene_objects.law_of(scene.adhesion)
    kappa = series.kappa_of(2 * np.pi * np.fft.rfftfreq(count, period / count))
    stiffness = scene.grid.length**2 / (depth / kappa + 1.0 / law.overlap_stiffness)
    mean = way.mean() + curve["displacement [m]"].to_numpy()[~last][-1]
    periodic = -np.fft.irfft(stiffness * np.fft.rfft(way - way.mean()), count) - stiffness[0].real * mean
    expected = np.interp((time - begun) % period, at, periodic, period=period)
    assert np.abs(force - expected).max() < 1e-3 * np.ptp(periodic)
    assert numbers[-1, 0] == pytest.approx(numbers[-2, 0], rel=1e-3) and numbers[0, 0] > 1.05 * numbers[-1, 0]


TACK = {
    "punch": {"pattern": "triangular", "radius": "375 um", "wavelength": "150 um", "amplitude": "4 um"},
    "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
    "rheology": {"model": "single", "modulus_ratio": 20.0, "relaxation_time": "5 ms"},
    "adhesion": {"law": "cosine", "work_of_adhesion": "50 mJ/m^2"},
    "grid": {"n": 20, "length": "1.5 mm"},
}
PRESSED = {"do": "approach", "speed": "20 um/s", "until": "3 mN"}
RETRACTED = {"do": "retract", "speed": "20 um/s", "until": "free"}


def tack(steps, accuracy=0.01, drive=(), **solver):
    """A corrugated punch on a grid as coarse as it can be."""
    return pgfmd.Scene({**TACK, "drive": {"step": steps, **dict(drive)}, "solver": {"accuracy": accuracy, **solver}})


def test_a_held_pull_creeps_off_above_the_quasistatic_pull_off_and_stays_below_it():
    """When it comes off, the run ends before the time of the hold is over where nothing but retraction is left, and goes on
    with the next step where there is one."""
    still = pgfmd.simulate(tack([PRESSED, RETRACTED], scheme="quasistatic")).run["pull_off_force_N"]

    def held(share, *more):
        pulled = {"do": "ramp", "rate": "-1 N/s", "until": f"{-share * still} N"}
        return pgfmd.simulate(
            tack([PRESSED, pulled, {"do": "hold", "of": "load", "for": "20 s", "turn_time": "1 us"}, *more])
        )

    below, above = held(0.94), held(1.06)
    assert below.run["finished"] == "completed" and above.run["finished"] == "detached"
    assert below.curve["time [s]"].iloc[-1] > 20.0 > above.curve["time [s]"].iloc[-1]
    assert below.curve["force [N]"].iloc[-1] == pytest.approx(-0.94 * still, rel=1e-3)
    assert above.curve["contact_area [m^2]"].iloc[-1] == 0.0
    again = held(1.06, PRESSED, RETRACTED)
    assert again.run["finished"] == "detached" and again.curve["stage"].iloc[-1] == 5
    assert again.curve["force [N]"][again.curve["stage"] == 4].max() == pytest.approx(3e-3, rel=1e-3)


MIXED = [
    PRESSED,
    {"do": "hold", "of": "load", "for": "20 ms"},
    {"do": "ramp", "rate": "20 mN/s", "until": "4 mN"},
    {"do": "oscillate", "amplitude": "30 nm", "frequency": "100 Hz", "cycles": 0.5},
    {"do": "oscillate", "amplitude": "0.5 mN", "frequency": "100 Hz", "cycles": 0.5},
    {"do": "retract", "speed": "50 um/s", "until": "-0.3 mN"},
    {"do": "hold", "of": "load", "for": "10 ms"},
    RETRACTED,
]
SCHEMES = {
    "inertialess": {}, "quasistatic": {"scheme": "quasistatic"},
    "gfmd": {"scheme": "gfmd", "gfmd": {"omega_tau": 16.0, "steps_per_tau": 64.0}},
}  # fmt: skip


def residual(found):
    """Largest residual of the audit, relative to the work of the loop."""
    return np.abs(found.energy["residual [J]"]).max() / abs(found.energy["work [J]"].iloc[-1])


@pytest.mark.parametrize("machine", [{}, {"machine_stiffness": "3 kN/m"}], ids=["rigid", "spring"])
def test_energies_of_programmes_add_up_ever_better(machine):
    twice = {"repeat": {"times": 2}, **machine}
    found = [residual(pgfmd.simulate(tack(MIXED, accuracy, twice))) for accuracy in (0.01, 1e-3)]
    assert found[0] < 0.02 and found[1] < 4e-3


def test_quasistatic_energies_add_up_where_the_machine_controls_now_the_load_and_now_the_place():
    """With a softest mode from before the change of springs the surface left G0 w, and the energies with it."""
    found = pgfmd.simulate(tack(MIXED, 0.02, {"machine_stiffness": "3 kN/m"}, scheme="quasistatic"))
    assert residual(found) < 0.01


def test_cycles_of_a_load_are_snapped_in_and_torn_off_alike():
    """Free punches on the soft spring of a load found contacts too early, and what their jumps released was that of the
    spring: 200 nJ for 8, and a thousand steps."""
    steps = [
        {"do": "ramp", "rate": "20 mN/s", "until": "3 mN"}, {"do": "ramp", "rate": "-20 mN/s", "until": "free"},
    ]  # fmt: skip
    rheology = {"modulus_ratio": 1000.0, "elements": 13, "relaxation_time": "1 us", "time_ratio": 6.0, "exponent": 0.5}
    scene = tack(steps, 1e-3, {"repeat": {"times": 3}})
    found = pgfmd.simulate(scene.replace(rheology={"model": "geometric", **rheology}))
    assert residual(found) < 5e-3 and found.run["steps"] < 600 and found.run["jumps"] == 6
    released = [cycle["released_J"] for cycle in found.run["cycles"]]
    assert released[2] == pytest.approx(released[1], rel=0.05)


class _Switches(Observer):
    """Force, place and energies before and after a change between displacement and load."""

    def __init__(self):
        self.before, self.apart, self.control = None, [], ""

    def before_step(self, simulation):
        if self.control and simulation.phase.control != self.control:
            self.apart.append(np.abs(np.array(self._of(simulation)) / self.before - 1.0).max())
        self.control = simulation.phase.control

    def observe(self, simulation, event):
        self.before = self._of(simulation)

    @staticmethod
    def _of(simulation):
        state = simulation.state
        return simulation.punch_position, state.force, state.energies.work, state.energies.elastic


@pytest.mark.parametrize("scheme", SCHEMES)
def test_nothing_is_lost_where_displacement_and_load_take_turns(scheme):
    from mpi4py import MPI

    from pgfmd.assemble import assemble

    simulation, switches = assemble(tack(MIXED, 0.05, **SCHEMES[scheme]), MPI.COMM_SELF), _Switches()
    simulation.observers.append(switches)
    state = simulation.run()
    assert state.finished == "detached"
    assert len(switches.apart) == sum(
        before.control != after.control for before, after in zip(simulation.phases, simulation.phases[1:], strict=False)
    )
    assert max(switches.apart) < 1e-12
    assert state.energies.largest_residual < 0.06 * state.energies.work


def test_explicit_steps_tend_to_massless_ones_through_a_held_load_and_an_oscillation():
    """With 1/omega: what is left of two of them extrapolated is a third of the error of the better one, and less."""
    steps = [*MIXED[:4], RETRACTED]
    followed = {2: "displacement [m]", 4: "force [N]"}
    massless, *others = (
        pgfmd.simulate(scene).curve
        for scene in (
            tack(steps, 1e-3),
            *(tack(steps, scheme="gfmd", gfmd={"omega_tau": x, "steps_per_tau": 4 * x}) for x in (8.0, 16.0)),
        )
    )
    for stage, name in followed.items():
        # What is not controlled, at the same time since the start of the step.
        mine, *theirs = (c[(c["stage"] == stage) & (c["phase"] != "turn")] for c in (massless, *others))
        time = mine["time [s]"] - mine["time [s]"].iloc[0]
        coarse, fine = (np.interp(time, c["time [s]"] - c["time [s]"].iloc[0], c[name]) for c in theirs)
        errors = [np.abs(found - mine[name]).max() for found in (coarse, fine, 2 * fine - coarse)]
        assert errors[1] < 0.65 * errors[0] and errors[2] < 0.35 * errors[1]


def test_the_loss_of_a_nearly_elastic_contact_is_found_at_the_usual_accuracy_with_a_small_amplitude():
    """Solves that are exact to a share of the range of adhesion alone would make it negative."""
    steps = [
        {"do": "approach", "speed": "10 um/s", "until": "4 mN"},
        {"do": "hold", "duration": "0.2 s"},
        {"do": "oscillate", "amplitude": "5 nm", "frequency": "10 Hz", "cycles": 2},
    ]
    rheology = {"modulus_ratio": 3, "relaxation_time": "400 us"}
    found = []
    for accuracy in (0.01, 0.001):
        scene = pgfmd.Scene(
            "flat-punch", rheology=rheology, grid={"n": 20}, solver={"accuracy": accuracy}, output={"energy": False},
            drive={"speed": None, "preload": None, "step": steps},
        )  # fmt: skip
        curve = pgfmd.simulate(scene).loop
        rows = np.flatnonzero(curve.phase == "oscillate")
        end = curve.time[rows[-1]] - 0.1
        rows = rows[(curve.time[rows] <= end) & (curve.time[rows] >= end - 0.1)]
        stiffness, _ = stiffness_of(curve.time[rows], curve.displacement[rows], curve.force[rows], 10.0)
        found.append(stiffness)
    assert found[0] == pytest.approx(found[1], rel=2e-3)
    assert found[0].imag == pytest.approx(found[1].imag, rel=0.03) and found[0].imag > 0.0


def test_a_hold_that_waits_for_what_never_comes_is_given_up():
    steps = [
        {"do": "approach", "speed": "20 um/s", "until": "4 mN"},
        {"do": "hold", "of": "load", "until": "5 um"},
        {"do": "retract", "speed": "50 um/s"},
    ]
    scene = pgfmd.Scene(
        "flat-punch", rheology={"modulus_ratio": 10}, grid={"n": 20},
        drive={"speed": None, "preload": None, "step": steps},
    )  # fmt: skip
    run = pgfmd.simulate(scene).run
    assert run["finished"] == "detached"
    assert len(run["unmet_ends"]) == 1 and "step 2: given up" in run["unmet_ends"][0]
