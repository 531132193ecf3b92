"""What is warned of where the grid, the law, the cell or the turn cannot do justice to a contact, and how well it is
known."""

import math
import re

import numpy as np
import pytest

from pgfmd.forecast import resolution
from pgfmd.forecast.advice import remarks, warnings
from pgfmd.forecast.contact_advice import overlap
from pgfmd.forecast.resolution import image_stiffness, overlap_share, summit_points
from pgfmd.scene import load_scene

WEAK = (
    "hertz",
    "grid.n=32",
    "adhesion.law=cosine",
    "adhesion.range_factor=0.156",
    "adhesion.work_of_adhesion=5e-7 J/m^2",
)
"""A sphere whose height over one cell is sixteen times the range of adhesion."""
FILM = ("flat-punch", "substrate.boundary=periodic", "substrate.poisson_ratio=0.495")


def told(rule, name: str, *overrides: str) -> str:
    return "\n".join(rule(load_scene(name, overrides)))


def points_of(*scene: str) -> float:
    return summit_points(load_scene(scene[0], scene[1:]))


def test_points_of_a_summit_are_those_within_the_range_of_its_height():
    scene = load_scene("tri-tack", ["grid.n=512", "adhesion.range=1 um"])
    # Counted under a summit of the lattice, at (0, -sqrt(3)/4 wavelength), as the grid would have them.
    spacing = scene.grid.length / scene.grid.n
    offset = (np.arange(-60, 60) + 0.3) * spacing
    x, y = np.meshgrid(offset, offset)
    q = 2 * math.pi / scene.punch.wavelength
    waves = 1.5 + 2 * np.cos(q * x) * np.cos(q * y / math.sqrt(3)) + np.cos(2 * q * y / math.sqrt(3))
    height = 2 * scene.punch.amplitude - 4 / 9 * scene.punch.amplitude * waves
    near = np.hypot(x, y) < 0.5 * scene.punch.wavelength
    # The summit is a little flatter than its parabola.
    assert summit_points(scene) == pytest.approx(np.count_nonzero((height < scene.adhesion.range) & near), rel=0.06)


def test_every_pattern_has_its_points():
    wide = ("flat-punch", "punch.curvature_radius=50 mm", "adhesion.range=0.5 um", "grid.n=128")
    spacing = 1.5e-3 / 128
    assert points_of(*wide) == pytest.approx(2 * math.pi * 0.05 * 0.5e-6 / spacing**2)
    assert points_of("flat-punch") == math.inf
    sphere = ("hertz", "adhesion.law=cosine", "adhesion.range=0.2 um")
    cubic = [*sphere, "punch.pattern=power", "punch.exponent=2"]
    assert points_of(*cubic) == pytest.approx(points_of(*sphere), rel=1e-12)
    flatter = points_of(*sphere, "punch.pattern=power", "punch.exponent=3")
    assert flatter == pytest.approx(math.pi * (0.01 * (3 * 0.2e-6 / 0.01) ** (1 / 3) / (1.5e-3 / 256)) ** 2)
    sinusoid = ("tri-tack", "punch.pattern=sinusoid", "punch.wavelength=150 um", "punch.amplitude=1 um", "grid.n=64")
    assert points_of(*sinusoid) == points_of(*sinusoid, "punch.height_jitter=10 nm")
    # A layer much thicker than the range leaves a plateau; a very thin one changes nothing.
    assert points_of(*sphere, "punch.layer_step=4 um") > 4 * points_of(*sphere)
    assert points_of(*sphere, "punch.layer_step=1 nm") == pytest.approx(points_of(*sphere), rel=0.02)


@pytest.mark.parametrize("most", [2**20, 2**12])
def test_a_map_is_judged_by_its_lowest_summits(tmp_path, monkeypatch, most):
    monkeypatch.setattr(resolution, "MOST_POINTS", most)
    side = (np.arange(256) + 0.5) / 256 * 1e-3 - 0.5e-3
    x, y = np.meshgrid(side, side)
    ball, rough = tmp_path / "ball.npy", tmp_path / "rough.npy"
    np.save(ball, (x**2 + y**2) / 0.02)
    np.save(rough, np.random.default_rng(1).normal(0.0, 2e-6, x.shape))
    a_map = ["punch.pattern=file", 'punch.file_size=["1 mm", "1 mm"]', "punch.curvature_radius=inf"]
    cell = ("punch.radius=375 um", "grid.n=256", "grid.length=1 mm", "substrate.boundary=periodic")
    sphere = ("hertz", "adhesion.law=cosine", "adhesion.range=0.2 um", *cell)
    by_map = points_of(*sphere, *a_map, f"punch.file={ball}")
    assert by_map == pytest.approx(points_of(*sphere), rel=1e-3)
    assert points_of(*sphere, *a_map, f"punch.file={rough}") < 1.0
    assert "whole cells" in told(warnings, *sphere, *a_map, f"punch.file={rough}")
    flat = tmp_path / "flat.npy"
    np.save(flat, np.zeros((8, 8)))
    assert points_of(*sphere, *a_map, f"punch.file={flat}") == math.inf


def test_a_summit_that_the_grid_cannot_resolve_is_warned_of():
    text = told(warnings, *WEAK)
    assert "grid points lie within the range" in text and "33 times too large" in text and "n >= 506" in text
    assert "whole cells" not in told(warnings, *WEAK, "grid.n=506")
    assert "whole cells" in told(warnings, *WEAK, "grid.n=505")
    assert "single summit" in told(remarks, *WEAK, "grid.n=506")
    assert "single summit" not in told(remarks, "tri-tack", "grid.n=512")
    # Without attraction it is the indentation that has to be resolved.
    assert "reach below the surface" in told(warnings, "hertz", "grid.n=32", "drive.preload=10 uN")


def test_a_soft_overlap_is_warned_of_and_the_cure_works():
    assert "overlap" not in told(warnings, "hertz")
    assert "range_factor 1.5 times larger" in told(warnings, "hertz", "grid.n=32")
    assert "overlap" not in told(warnings, "hertz", "grid.n=32", "adhesion.range_factor=1.5")
    # At the speed of glass the contact is as much stiffer, and the wall is not.
    glass = ("hertz", "rheology.model=single", "rheology.modulus_ratio=100", "rheology.relaxation_time=1000 s")
    slow, fast = (load_scene(glass[0], glass[1:]), load_scene("hertz"))
    assert overlap_share(slow) == pytest.approx(100 ** (4 / 3) * overlap_share(fast), rel=0.01)
    assert "overlap" in told(remarks, "hex-tack") and "overlap" not in told(remarks, "tri-tack", "grid.n=2048")
    # While a soft wall gives way an elastomer relaxes: such a run had 1.28 um of overlap, weighted with the load, of 2.1 um.
    quick = load_scene("tri-tack", ["drive.speed=200 um/s", "drive.preload=10 mN", "grid.n=128"])
    assert overlap_share(quick) == pytest.approx(1.28 / (2.1 - 1.28), rel=0.3)
    # On a thin film a contact is stiffer still.
    thin = load_scene(FILM[0], [*FILM[1:], "substrate.thickness=20 um"])
    assert overlap_share(thin) > 5 * overlap_share(load_scene(FILM[0], FILM[1:]))


def test_the_cure_of_an_overlap_with_attraction_is_a_shorter_range():
    stiff = ("hertz", "adhesion.law=cosine", "grid.n=64", "rheology.model=single", "rheology.modulus_ratio=100",
             "rheology.relaxation_time=1000 s")  # fmt: skip
    text = told(overlap, *stiff)
    cure = re.search(r"Use grid.n >= (\d+)$", text)[1]
    assert told(overlap, *stiff, f"grid.n={cure}") == "" != told(overlap, *stiff, f"grid.n={int(cure) - 1}")
    # The smaller the contact, the stiffer: a smaller preload makes it worse.
    scene = load_scene(stiff[0], stiff[1:])
    assert overlap_share(load_scene(stiff[0], [*stiff[1:], "drive.preload=1 mN"])) > overlap_share(scene)
    given = (*stiff, f"adhesion.range={scene.adhesion.range * 1.01} m")
    assert "a shorter adhesion.range makes it less" in told(remarks, "hex-tack", "adhesion.range=0.9 um")
    text = told(overlap, *given)
    assert "grid.n" not in text and "overlap" in told(overlap, *given, "grid.n=512")
    cure = re.search(r"Set adhesion.range to (\S+ .m) or less", text)[1]
    assert told(overlap, *given, f"adhesion.range={cure}") == ""


@pytest.mark.parametrize(
    # Periodic over free stiffness of whole runs (n = 48, law repulsive, range_factor 20), punch radius L/4.
    ("thickness", "base", "ratio", "measured"),
    [(1 / 8, "bonded", 0.495, 1.017), (1 / 4, "bonded", 0.495, 1.098), (1, "bonded", 0.495, 1.679),
     (1 / 32, "sliding", 0.495, 1.233), (1, "sliding", 0.495, 1.873), (1 / 4, "bonded", 0.3, 1.002), (2, "bonded", 0.3, 0.730)],
)  # fmt: skip
def test_images_of_a_film_are_as_strong_as_in_runs(thickness, base, ratio, measured):
    film = [
        f"substrate.thickness={thickness * 1.5e-3:.9g} m",
        f"substrate.base={base}",
        f"substrate.poisson_ratio={ratio}",
    ]
    scene = load_scene(FILM[0], [*FILM[1:], *film])
    assert image_stiffness(scene) == pytest.approx(measured, abs=0.06 * max(1.0, measured))
    assert ("goes on without other" in "\n".join(warnings(scene))) == (abs(measured - 1) > 0.05)


def test_a_film_thinner_than_the_spacing_is_warned_of():
    assert "thinner than" in told(warnings, *FILM, "substrate.thickness=5 um")
    assert "thinner than" not in told(warnings, *FILM, "substrate.thickness=6 um")
    assert "goes on without" not in told(warnings, *FILM, "substrate.thickness=2 mm", "substrate.boundary=free")


def test_a_turn_that_is_a_motion_of_its_own_is_warned_of():
    fast = ("tri-tack", "drive.retract_speed=100 um/s")
    assert "drive.turn_time" not in told(warnings, *fast)
    text = told(warnings, *fast, "drive.turn_time=0.06 s")
    assert "comes back by" in text and "below the speed of the retraction" in text
    cure = text.split('at most "')[1].split('"')[0]
    assert "drive.turn_time" not in told(warnings, *fast, f"drive.turn_time={cure}")
    assert "goes on by" in told(warnings, "tri-tack", "drive.retract_speed=0.01 um/s", "drive.turn_time=1 s")
    # Infinitely slow loading knows no speed, and a spring's way is not the punch's.
    slow = ("tri-tack", "solver.scheme=quasistatic", "drive.control=load", "output.snapshots=[]")
    assert "drive.turn_time" not in told(warnings, *slow)
    # Nor a dwell, which would make of the turn one half at each speed.
    slow = ("tri-tack", "solver.scheme=quasistatic", "drive.retract_speed=100 um/s", "drive.turn_time=1 s")
    assert "drive.turn_time" not in told(warnings, *slow, "drive.dwell=1 s")


def test_a_start_beyond_the_preload_is_foreseen():
    start = ("hertz", "drive.clearance=-20 um")
    assert "will refuse it" in told(warnings, *start, "drive.preload=10 uN")
    assert "will refuse it" not in told(warnings, *start, "drive.preload=40 mN")
    assert "will refuse it" not in told(warnings, "hertz", "drive.clearance=-1 um")
    # Adhesion draws a sphere in by more than so small a preload presses it.
    sticky = ("hertz", "grid.n=64", "adhesion.law=cosine", "adhesion.range_factor=0.156", "drive.preload=0.1 mN")
    assert "will refuse it" not in told(warnings, *sticky, "drive.clearance=-1 um")
    assert "will refuse it" in told(warnings, *sticky, "drive.clearance=-20 um")
    # How deep the preload goes is not known where the compliance is a table.
    scene = load_scene(start[0], [*start[1:], "drive.preload=10 uN"])
    substrate = scene.substrate.model_copy(update={"compliance_file": "soft.txt"})
    assert "will refuse it" not in "\n".join(warnings(scene.model_copy(update={"substrate": substrate})))
