"""All laws of adhesion: slopes by finite differences, what they say of themselves, their closed forms, laws from files."""

import math
from types import SimpleNamespace

import numba
import numpy as np
import pytest

from pgfmd.errors import SceneError
from pgfmd.physics.adhesion import cut_off
from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.adhesion.dugdale import Dugdale
from pgfmd.physics.adhesion.exponential import Exponential
from pgfmd.physics.adhesion.lennard_jones import LennardJones
from pgfmd.physics.adhesion.registry import LAWS, law_of, range_by_rule
from pgfmd.physics.adhesion.repulsive import Repulsive
from pgfmd.physics.adhesion.table import Table, read_law
from pgfmd.scene import Scene, parse_scene
from pgfmd.solver.inlined_laws import attraction

GAMMA, RHO = 0.05, 0.75e-6
ROWS = (0.0, 0.05e-6, 0.2e-6, 0.4e-6, RHO), (0.0, 4e4, 1.5e5, 1.5e5, 0.0)
EXAMPLES = {
    "cosine": Cosine(GAMMA, RHO),
    "repulsive": Repulsive(GAMMA, RHO, 3e11),
    "dugdale": Dugdale(GAMMA, RHO, 2e12, 0.3),
    "exponential": Exponential(GAMMA, RHO, 5e11),
    "lennard-jones": LennardJones(GAMMA, RHO),
    "table": Table(GAMMA, RHO, None, *ROWS),
}


@pytest.fixture(params=EXAMPLES)
def law(request):
    return EXAMPLES[request.param]


def test_every_law_has_an_example():
    assert list(EXAMPLES) == list(LAWS) and all(type(law) is LAWS[name] for name, law in EXAMPLES.items())


def test_slopes_are_those_of_the_energy(law):
    """Central differences, away from the places where the curvature jumps: errors of second order, and small ones."""
    gaps = law.range * np.array([-2.0, -0.3, 0.11, 0.19, 0.37, 0.41, 0.63, 0.77, 0.9, 1.07, 1.4, 3.0, 7.1, 14.0])
    for slope, function in ((law.traction, law.potential), (law.curvature, law.traction)):
        coarse, fine = (
            np.abs((function(gaps + h) - function(gaps - h)) / (2 * h) - slope(gaps))
            for h in (4e-3 * law.range, 2e-3 * law.range)
        )
        scale = np.abs(slope(gaps)).max()
        assert np.all(fine < 1e-3 * scale)
        curved = coarse > 1e-7 * scale
        np.testing.assert_allclose(coarse[curved] / fine[curved], 4.0, rtol=0.05)


def test_energies_and_tractions_have_no_jumps(law):
    edges = [0.0, law.reach, *([law.numbers.width, law.numbers.fall] if law.name == "dugdale" else ())]
    edges += list(law.numbers.knots) if law.name == "table" else []
    for edge in edges:
        below, above = edge - 1e-9 * law.range, edge + 1e-9 * law.range
        assert law.potential(below) == pytest.approx(law.potential(above), abs=1e-8 * GAMMA)
        assert law.traction(below) == pytest.approx(law.traction(above), abs=1e-7 * max(law.strength, 1.0) + 1e-3)
    assert law.potential(law.reach) == law.traction(law.reach) == law.curvature(law.reach) == 0.0
    assert law.traction(0.0) == 0.0 and law.curvature(-1e-12) == law.overlap_stiffness


@numba.njit
def in_a_kernel(gaps, law, found):
    """The functions of a law at each gap, as kernels have them (solver/inlined_laws.py)."""
    for i in range(gaps.size):
        pull, bend, depth, level = attraction(gaps[i], law)
        found[0, i], found[1, i], found[2, i] = pull, bend, depth * level


@pytest.mark.parametrize("name", ["exponential", "lennard-jones", "table"])
def test_compiled_laws_are_those_of_numpy(name):
    law = EXAMPLES[name]
    gaps = np.append(np.linspace(-0.5, 0.999, 401) * law.reach, law.numbers.knots if name == "table" else 0.0)
    gaps = gaps[gaps < law.reach]
    found = np.full((3, gaps.size), np.nan)
    in_a_kernel(gaps, law.numbers, found)
    overlap = law.overlap_stiffness * np.minimum(gaps, 0.0)
    expected = (
        law.traction(gaps) - overlap,
        law.curvature(gaps),
        law.potential(gaps) - 0.5 * overlap * np.minimum(gaps, 0.0),
    )
    for ours, theirs, scale in zip(found, expected, (law.strength, law.stiffness, GAMMA), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12 * scale)


def test_what_a_law_says_of_itself(law):
    gaps = np.linspace(0.0, max(law.reach, law.range), 400_001)
    traction, curvature = law.traction(gaps), law.curvature(gaps)
    assert traction.max() == pytest.approx(law.strength, rel=1e-6)
    assert np.abs(curvature).max() == pytest.approx(law.stiffness if law.attractive else 0.0, rel=1e-4)
    if not law.attractive:
        assert law.contact_gap == law.reach == 0.0
        return
    # Opening the interface costs the work of adhesion, exactly.
    assert np.trapezoid(traction, gaps) == pytest.approx(GAMMA, rel=1e-6)
    assert law.potential(0.0) == pytest.approx(-GAMMA, rel=1e-14)
    assert law.traction(law.contact_gap) == pytest.approx(law.strength, rel=1e-9)
    inside = (gaps > 0.0) & (gaps < law.reach)
    held = inside & (gaps < law.contact_gap * (1 - 1e-6))
    assert np.all(curvature[held] > 0.0)
    # A stiffness of 0 is what a point out of reach has. The cosine's passes through it.
    assert np.all((curvature != 0.0) | ~inside | (np.abs(gaps - law.contact_gap) < 1e-12 * law.range))
    assert law.stiffness * law.length**2 == pytest.approx(math.pi**2 / 2 * GAMMA, rel=1e-12)


def test_the_automatic_range_makes_all_laws_as_stiff(tmp_path):
    (tmp_path / "law.txt").write_text("gap [um] traction [kPa]\n0 0\n0.3 100\n1 0\n")
    for name, kind in LAWS.items():
        given = {"law": name, "overlap_stiffness": None, "smoothing": 0.2, "file": tmp_path / "law.txt"}
        adhesion = SimpleNamespace(**given, work_of_adhesion=GAMMA, range=None)
        adhesion.range = range_by_rule(adhesion, 2e6, 0.156, 1e7)
        assert kind.of(adhesion).stiffness == pytest.approx(0.156 * 1e7 * 2e6, rel=1e-12)


def test_dugdales_law_is_constant_between_its_ends():
    law = Dugdale(GAMMA, RHO, smoothing=0.1)
    flat = np.linspace(0.1, 0.98, 50) * RHO
    np.testing.assert_allclose(law.traction(flat), GAMMA / RHO, rtol=1e-14)
    assert law.reach == pytest.approx(RHO * (1.0 + 0.1 * (1.5 - 2 / math.pi)), rel=1e-14)
    assert law.traction(0.05 * RHO) == pytest.approx(GAMMA / RHO * math.sin(math.pi / 4), rel=1e-14)


@pytest.mark.parametrize(("law", "height", "strength"), [
    (Exponential(GAMMA, RHO), lambda x: x * np.exp(-x), 1 / math.e),
    (LennardJones(GAMMA, RHO), lambda x: 8 / 3 * ((1 + x) ** -3.0 - (1 + x) ** -9.0), 16 / (9 * math.sqrt(3))),
])  # fmt: skip
def test_laws_without_an_end_are_what_they_are_called(law, height, strength):
    """But for what the smooth end at 12 ranges changes: 1e-4 of the work, or 1 %."""
    share = 1.2e-3 if isinstance(law, Exponential) else 0.012
    x = np.linspace(0.0, cut_off.CUT_OFF, 1000)
    np.testing.assert_allclose(
        law.traction(x * RHO), GAMMA / RHO * height(x), rtol=0, atol=share * strength * GAMMA / RHO
    )
    assert law.strength == pytest.approx(strength * GAMMA / RHO, rel=share)
    assert law.stiffness == pytest.approx(law.stiffness_number(None) * GAMMA / RHO**2, rel=1e-14)


LAW = "\n# a law\n# gap [nm], traction [kPa]\n0, 0\n20, 60 # the top\n80, 25\n200, 0\n"


def test_a_law_from_a_file(tmp_path):
    """Values of its rows, monotone between them; the work and range are its own, or scaled to those that are asked for."""
    path = tmp_path / "law.csv"
    path.write_text(LAW)
    gaps, tractions = read_law(path)
    np.testing.assert_allclose(gaps, [0.0, 2e-8, 8e-8, 2e-7], rtol=1e-15)
    own = Table.own_values(SimpleNamespace(file=path))
    law = Table(own["work_of_adhesion"], own["range"], None, gaps, tractions)
    np.testing.assert_allclose(law.traction(gaps), tractions, rtol=1e-14)
    fine = np.linspace(0.0, 2e-7, 20_001)
    assert np.trapezoid(law.traction(fine), fine) == pytest.approx(own["work_of_adhesion"], rel=1e-7)
    rising = np.diff(law.traction(fine))
    assert np.all(rising[fine[1:] <= 2e-8] >= 0) and np.all(rising[fine[:-1] >= 2e-8] <= 0)
    scaled = Table(3 * own["work_of_adhesion"], 2 * own["range"], None, gaps, tractions)
    np.testing.assert_allclose(scaled.traction(2 * fine), 1.5 * law.traction(fine), rtol=1e-13, atol=1e-9)
    assert scaled.strength == pytest.approx(9e4) and scaled.contact_gap == pytest.approx(4e-8)
    path.write_text("traction (MPa)\tgap (um)\n0\t0\n0.06\t0.02\n0.025\t0.08\n0\t0.2\n")
    np.testing.assert_allclose(read_law(path), [gaps, tractions], rtol=1e-13)


@pytest.mark.parametrize(("text", "told"), [
    ("0 0\n1 1\n2 0\n", "names and units of its columns, such as: gap"),
    ("gap [nm] force [N]\n0 0\n1 1\n2 0\n", "line 1: expected the two columns"),
    ("gap [s] traction [kPa]\n0 0\n1 1\n2 0\n", "line 1: the unit of gap: expected a length"),
    ("gap [nm] traction [kPa]\n0 0\n1 one\n2 0\n", "line 3: expected numbers"),
    ("gap [nm] traction [kPa]\n0 0\n1\n2 0\n", "line 3: expected 2 finite numbers"),
    ("gap [nm] traction [kPa]\n0 0\n2 0\n", "three rows, found 2"),
    ("gap [nm] traction [kPa]\n1 0\n2 5\n3 0\n", "a first row with the gap 0 and the traction 0"),
    ("gap [nm] traction [kPa]\n0 0\n2 5\n1 6\n3 0\n", "gaps that ascend"),
    ("gap [nm] traction [kPa]\n0 0\n2 5\n3 1\n", "a last row with the traction 0"),
    ("gap [nm] traction [kPa]\n0 0\n2 -5\n3 0\n", "tractions that attract"),
])  # fmt: skip
def test_files_that_hold_no_law_are_refused(tmp_path, text, told):
    (tmp_path / "law.txt").write_text(text)
    with pytest.raises(ValueError, match=told):
        read_law(tmp_path / "law.txt")


def test_a_scene_takes_the_work_and_the_range_of_its_file_or_scales_it(tmp_path):
    (tmp_path / "law.csv").write_text(LAW)
    tables = {"law": "table", "file": str(tmp_path / "law.csv"), "work_of_adhesion": None, "range": None}
    own = Scene("tri-tack", adhesion=tables)
    assert own.adhesion.range == own.drive.clearance == pytest.approx(2e-7)
    assert law_of(own.adhesion).strength == pytest.approx(6e4) and own.adhesion.work_of_adhesion < 0.006
    assert parse_scene(own.to_toml()) == own
    scaled = own.replace(adhesion={"work_of_adhesion": 0.05, "range": "auto"})
    assert scaled.adhesion.range > 1e-6 and scaled.adhesion.work_of_adhesion == 0.05
    with pytest.raises(SceneError, match=r"adhesion.file = \(missing\)"):
        own.replace(adhesion={"file": None})
    (tmp_path / "law.csv").write_text("gap [nm] traction [kPa]\n0 1\n")
    with pytest.raises(
        SceneError, match=r"adhesion\.file = .*law.csv.: expected a law of adhesion; expected at least three"
    ):
        Scene("tri-tack", adhesion=tables)


def test_keys_belong_to_their_laws():
    scene = Scene("tri-tack", adhesion={"law": "dugdale"})
    assert scene.adhesion.smoothing == 0.2 and "smoothing" in scene.to_toml()
    assert "smoothing" not in scene.replace(adhesion={"law": "cosine"}).to_toml()
    with pytest.raises(SceneError, match=r'adhesion\.smoothing = 0.3: .* choose law = "dugdale"'):
        Scene("tri-tack", adhesion={"smoothing": 0.3})
