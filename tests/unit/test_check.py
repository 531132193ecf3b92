"""What `pgfmd check` says: the paper's numbers, memory as allocated, effort as measured, and when it warns."""

import math
import tracemalloc

import numpy as np
import pytest

from pgfmd.commands.check import report
from pgfmd.forecast.effort import effort_of
from pgfmd.forecast.estimate import memory_of
from pgfmd.scene import load_scene
from pgfmd.symmetry import expected

GEOMETRIC = [
    "rheology.model=geometric", "rheology.modulus_ratio=250", "rheology.relaxation_time=40 us", "rheology.elements=5",
    "rheology.time_ratio=6", "rheology.exponent=0.8",
]  # fmt: skip

INSTANTANEOUS = ["solver.scheme=quasistatic", "solver.modulus=instantaneous", "output.snapshots=[]"]


def warnings_of(name: str, *overrides: str) -> str:
    return "\n".join(report(load_scene(name, overrides)).warnings)


def remarks_of(name: str, *overrides: str) -> str:
    return "\n".join(report(load_scene(name, overrides)).remarks)


@pytest.mark.parametrize(
    ("n", "reach", "whole", "summit"), [(2048, 0.264e-6, 10.1, 1.46), (4096, 0.187e-6, 14.2, 2.06)]
)
def test_the_papers_numbers(n, reach, whole, summit):
    found = report(load_scene("tri-tack", [f"grid.n={n}"]))
    assert found["range rho"] == pytest.approx(reach, rel=3e-3)
    assert found["Tabor number of the whole punch"] == pytest.approx(whole, rel=5e-3)
    assert found["Tabor number of a summit"] == pytest.approx(summit, rel=5e-3)
    assert found["gamma/v_full"] == pytest.approx(0.33, abs=5e-3)
    assert found["contact modulus E*"] == 2e6 / (1 - 0.495**2)


def test_hexagonal_punch():
    found = report(load_scene("hex-tack"))
    assert found["gamma/v_full"] == pytest.approx(0.062, abs=5e-4)
    assert found["summit radius"] == pytest.approx(139.4e-6, rel=1e-3)


def test_a_sinusoid_has_its_own_energy():
    changes = ["punch.pattern=sinusoid", "punch.wavelength=150 um", "punch.amplitude=1 um"]
    found = report(load_scene("tri-tack", changes))
    # Johnson: (1/4) E* q A^2 with the amplitude A of the cosine
    energy = found["contact modulus E*"] * 2 * np.pi / 150e-6 * 1e-12 / 8
    assert found["gamma/v_full"] == pytest.approx(0.05 / energy, rel=1e-12)


def test_cohesive_zone_follows_the_range():
    own, half = (report(load_scene("tri-tack", [f"adhesion.range_factor={c}"])) for c in (0.156, 4 * 0.156))
    name = "grid points in the cohesive zone"
    assert own[name] == pytest.approx(1 / (4 * 0.156), rel=1e-12)
    assert half[name] == pytest.approx(own[name] / 4, rel=1e-12)


def test_times_of_the_rheology():
    found = report(load_scene("tri-tack"))
    # one element: lambda = kappa_inf tau, J_inf = 1/kappa_inf
    assert found["retardation time 1"] == pytest.approx(250 * 400e-6, rel=1e-12)
    assert found["J_inf"] == pytest.approx(1 / 250, rel=1e-12)
    five = report(load_scene("tri-tack", GEOMETRIC))
    assert "retardation time 5" in five and "retardation time 6" not in five


def test_values_are_si():
    found = report(load_scene("tri-tack", ["punch.radius=0.375 mm"]))
    assert found["punch.radius"] == 375e-6
    assert found["drive.preload"] == 40e-3
    assert "punch.file" not in found


def test_short_range_is_warned_of():
    assert warnings_of("tri-tack") == ""
    assert "mesh error is a percent or two" in warnings_of("tri-tack", "adhesion.range=0.6 um")
    assert "rho too small for the grid" in warnings_of("tri-tack", "adhesion.range=0.37 um")
    assert "rho" not in warnings_of("tri-tack", "adhesion.range=0.8 um")
    assert warnings_of("hertz") == ""


def test_coarse_wavelength_is_warned_of_and_the_cure_works():
    assert "use n >= 80" in warnings_of("tri-tack", "grid.n=79")
    assert "wavelength" not in warnings_of("tri-tack", "grid.n=80")


def test_preload_out_of_reach_is_warned_of():
    assert "given up at 375 um" in warnings_of("flat-punch", "drive.preload=1 N")
    assert "small slopes" in warnings_of("flat-punch", "drive.preload=0.2 N")
    assert warnings_of("flat-punch", "drive.preload=50 mN") == ""


def test_speed_beyond_relaxation_is_warned_of():
    assert "glass" in warnings_of("flat-punch", "drive.speed=0.3 m/s")
    assert "glass" in warnings_of("flat-punch", "drive.retract_speed=0.3 m/s")
    assert "glass" not in warnings_of("flat-punch", "drive.speed=1 mm/s")


def test_close_images_and_missing_memory_are_warned_of():
    assert "periodic images" in warnings_of("tri-tack", "grid.length=1 mm")
    assert "GB are needed" in warnings_of("tri-tack", "grid.n=65536", "rheology.model=elastic")


def test_jumps_and_far_displacement_are_remarked():
    assert "jumps" not in remarks_of("flat-punch", "grid.n=512")
    assert "jumps" in remarks_of("flat-punch", "grid.n=1024")
    assert "elastic" in remarks_of("tri-tack", "rheology.model=elastic")
    assert "jumps" not in remarks_of("hertz")
    assert "11 %" in remarks_of("tri-tack") and "11 %" not in remarks_of("flat-punch")


def test_keys_of_gfmd_that_no_other_scheme_reads_are_said():
    said = warnings_of("tri-tack", "solver.gfmd.omega_tau=3", "solver.gfmd.dt=10 us")
    for key in ("omega_tau", "dt"):
        assert f'solver.gfmd.{key} has no effect with solver.scheme = "inertialess", as only' in said
    assert "no effect" not in warnings_of("tri-tack")
    assert "no effect" not in warnings_of("tri-tack", "solver.gfmd.omega_tau=3", "solver.scheme=gfmd")


def test_what_gfmd_costs_and_adds_is_told():
    text = warnings_of("tri-tack", "solver.scheme=gfmd", "grid.n=256")
    assert "output.every" in text and "max_steps" in text
    assert "max_steps" not in warnings_of(
        "tri-tack", "solver.scheme=gfmd", "solver.max_steps=5000000", "output.every=100"
    )
    fast = "solver.scheme=gfmd", "drive.speed=1 mm/s"
    assert "under load control" in remarks_of("tri-tack", *fast, "drive.control=load")
    assert "under load control" not in remarks_of("tri-tack", *fast)
    soft = "solver.scheme=gfmd", "solver.max_steps=5000000", "output.every=100", "drive.machine_stiffness=10 N/m"
    assert "max_steps" in warnings_of("tri-tack", *soft) and "output.every" in warnings_of("tri-tack", *soft)
    # 2 kappa_inf/omega over kappa_1 tau_1, with omega tau = 2 pi: 250/(249 pi).
    assert "32 %" in remarks_of("tri-tack", "solver.scheme=gfmd")
    lines = {
        line.name: line.value
        for lines in report(load_scene("tri-tack", ["solver.scheme=gfmd"])).sections.values()
        for line in lines
    }
    assert lines["viscosity that the inertia adds"] == pytest.approx(250 / (249 * math.pi))
    assert lines["stability number"] < 2.0


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("tri-tack", []),
        ("tri-tack", [*GEOMETRIC, "rheology.elements=12"]),
        ("tri-tack", [*GEOMETRIC, "output.energy=false"]),
        ("tri-tack", ["solver.precision=single"]),
        ("tri-tack", ["solver.precision=mixed"]),
        ("tri-tack", ["solver.symmetry=none"]),
        ("tri-tack", ["solver.symmetry=none", "solver.precision=double"]),
        ("tri-tack", ["punch.pattern=flat"]),
        ("tri-tack", ["punch.pattern=flat", "solver.precision=double"]),
        ("tri-tack", ["solver.order=1"]),
        ("tri-tack", [*GEOMETRIC, "solver.scheme=gfmd"]),
        ("flat-punch", []),
        ("hertz", []),
    ],
)
def test_memory_is_what_a_run_allocates(name, overrides):
    from mpi4py import MPI

    from pgfmd.assemble import assemble
    from pgfmd.runner import warm_up

    scene = load_scene(name, [*overrides, "grid.n=512"])
    # Tables, plans and compiled kernels of the first time don't count: small scenes choose another precision.
    warm_up(scene.solver.scheme, scene.solver.precision)
    same = f"solver.precision={scene.solver.precision}"
    warm = assemble(load_scene(name, [*overrides, "grid.n=32", same]), MPI.COMM_SELF)
    for _ in range(4):
        warm.controller.advance(warm.state, warm.phase)
    tracemalloc.start()
    try:
        simulation = assemble(scene, MPI.COMM_SELF)
        for _ in range(4):
            simulation.controller.advance(simulation.state, simulation.phase)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    memory = memory_of(scene)
    assert max(memory.running, memory.start) == pytest.approx(peak, rel=0.15)


def test_memory_is_shared_out():
    scene = load_scene("tri-tack", ["grid.n=2048"])
    alone, four = memory_of(scene, 1), memory_of(scene, 4)
    # the two ranks in the middle of the punch have sin 60 + 60 in radians of its 180 degrees
    assert four.points == pytest.approx(alone.points * (math.sin(math.pi / 3) + math.pi / 3) / math.tau, rel=2e-3)
    # on several ranks the rows exist twice, once whole in x and once whole in y
    assert alone.transform <= 4 * four.transform < 2 * alone.transform


@pytest.mark.parametrize("n", [65536, 65535])
@pytest.mark.parametrize("more", [[], ["substrate.boundary=free"], ["solver.scheme=quasistatic"]])
def test_memory_of_the_largest_grid_shrinks_with_the_ranks(n, more):
    scene, ranks = load_scene("tri-tack", [f"grid.n={n}", *more]), [1, 3, 64, 1000, 4096]
    tracemalloc.start()
    try:
        found = [memory_of(scene, count) for count in ranks]
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()
    for memory, count in zip(found, ranks, strict=True):
        assert memory.peak < 1.5 * found[0].peak / count
    # All points under the punch, or a half that stands for them, twenty numbers each.
    assert found[0].peak > 20 * 8 * math.pi / 16 * n**2 / 2 ** len(expected(scene).mirror)


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        # Many more are in the table of counted runs that the forecast was fitted to.
        ("tri-tack", ["grid.n=64"]),
        ("hertz", ["grid.n=64", "drive.preload=20 mN"]),
        ("tri-tack", ["grid.n=32", "rheology.model=elastic"]),
        ("tri-tack", ["grid.n=32", "solver.scheme=gfmd", "drive.speed=200 um/s"]),
        ("hex-tack", ["grid.n=48", "solver.accuracy=0.03", *INSTANTANEOUS]),
        ("flat-punch", ["grid.n=48", "solver.accuracy=0.03", *INSTANTANEOUS]),
    ],
)
def test_effort_is_within_a_factor_of_three(name, overrides):
    from mpi4py import MPI

    from pgfmd.assemble import assemble

    scene = load_scene(name, overrides)
    simulation = assemble(scene, MPI.COMM_SELF)
    state, effort = simulation.run(), effort_of(scene)
    assert 1 / 3 < effort.steps / state.counters.steps < 3
    assert 1 / 3 < effort.pairs / simulation.scheme.pairs < 3
