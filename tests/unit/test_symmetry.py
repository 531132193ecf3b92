"""Which scenes are their own mirror images, what `check` says of it, and runs that go on with another setting."""

import re

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import assemble, mirror_of
from pgfmd.commands.check import report
from pgfmd.errors import SceneError
from pgfmd.parts import topography_of
from pgfmd.restart import checkpoint_file, checkpoint_layout, resume
from pgfmd.restart.sameness import differences
from pgfmd.scene import load_scene
from pgfmd.symmetry import expected, has_images, points_of
from tests.unit.small_runs import run

VISCOUS = ["rheology.model=single", "rheology.modulus_ratio=100", "rheology.relaxation_time=1 ms"]
HERTZ = ["hertz", *VISCOUS]
SCENES = [
    ("x", "", ["tri-tack"]),
    ("x", "", ["hex-tack", "substrate.boundary=free", "solver.precision=mixed"]),
    ("x", "", ["tri-tack", "punch.curvature_radius=50 mm", "punch.layer_step=0.2 um", "substrate.prestrain=[1.2, 0.9]"]),
    ("xy", "", ["flat-punch", "substrate.thickness=0.5 mm"]),
    ("xy", "", HERTZ),
    ("xy", "", [*HERTZ, "punch.pattern=power", "punch.exponent=3"]),
    ("xy", "", ["tri-tack", "punch.pattern=sinusoid"]),
    ("", "not its own mirror image", ["tri-tack", "punch.height_jitter=20 nm"]),
    ("", 'solver.symmetry = "none"', ["tri-tack", "solver.symmetry=none"]),
    ("", "grid.n is odd", ["flat-punch", "grid.n=101"]),
    ("", "elastic", ["flat-punch", "rheology.model=elastic"]),
    ("", "elastic", ["flat-punch", "rheology.modulus_ratio=1.9"]),
    ("", "equilibria", ["tri-tack", "solver.scheme=quasistatic"]),
    ("", "gfmd", ["tri-tack", "solver.scheme=gfmd"]),
]  # fmt: skip


@pytest.mark.parametrize(("mirror", "reason", "scene"), SCENES)
def test_the_symmetry_of_a_scene(mirror, reason, scene):
    source, *changes = scene
    scene = load_scene(source, ["grid.n=64", *changes])
    found = expected(scene)
    assert found.mirror == mirror and reason in found.reason and bool(found.reason) == (not mirror)
    assert mirror_of(scene, MPI.COMM_SELF) == mirror
    line = next(line for line in report(scene).sections["Cost"] if line.name == "mirror symmetry")
    assert line.value == {"": "none", "x": "x", "xy": "x, y"}[mirror]
    assert reason in line.note and {"": "all points", "x": "half", "xy": "a quarter"}[mirror] in line.note


@pytest.mark.parametrize("n", [20, 50, 154, 512])
def test_shipped_punches_have_the_bits_of_their_mirror_images(n):
    for source, axes in (("tri-tack", "x"), ("hex-tack", "x"), ("flat-punch", "xy"), ("hertz", "xy")):
        scene = load_scene(source, [f"grid.n={n}"])
        assert has_images(topography_of(scene.punch), points_of(scene, axes))
    # The lattices are shifted: their rows have no mirror line along y.
    scene = load_scene("tri-tack", [f"grid.n={n}"])
    assert not has_images(topography_of(scene.punch), points_of(scene, "xy"))


class Bump:
    """A round face with a bump on one point of the grid, or on none."""

    def __init__(self, x=np.nan, y=np.nan):
        self.x, self.y = x, y

    def heights(self, x, y):
        return x**2 + y**2 + 1e-18 * ((x == self.x) & (y == self.y))


@pytest.mark.parametrize("mirror", ["x", "xy"])
def test_one_point_that_differs_is_enough(mirror):
    points = points_of(load_scene("flat-punch", ["grid.n=600"]), mirror)
    x, y = points.coordinates()
    assert has_images(Bump(), points) and points.size > 2 * 8192
    for place in (0, 8192, points.size - 1):
        image = (-x[place], y[place]) if mirror == "x" else (x[place], -y[place])
        assert not has_images(Bump(x[place], y[place]), points)
        assert not has_images(Bump(*image), points)


def test_sums_and_numbers_of_points_are_those_of_the_whole_punch():
    scenes = (load_scene("flat-punch", ["grid.n=32", f"solver.symmetry={symmetry}"]) for symmetry in ("auto", "none"))
    part, whole = (assemble(scene, MPI.COMM_SELF) for scene in scenes)
    assert part.points.size * 4 == whole.points.size
    for simulation in (part, whole):
        simulation.run(only_to_preload=True)
    assert part.state.contact_points == whole.state.contact_points == whole.points.total == part.points.total
    assert part.state.force == pytest.approx(whole.state.force, rel=1e-9)
    assert part.state.energies.elastic == pytest.approx(whole.state.energies.elastic, rel=1e-9)
    assert part.state.energies.viscous == pytest.approx(whole.state.energies.viscous, rel=1e-9)


def test_the_key_takes_two_words():
    with pytest.raises(SceneError, match=r"solver\.symmetry"):
        load_scene("tri-tack", ["solver.symmetry=x"])


@pytest.mark.parametrize(("before", "after"), [("auto", "none"), ("none", "auto")])
def test_going_on_with_the_other_setting_is_refused_by_name(before, after, tmp_path):
    run(tmp_path, f"solver.symmetry={before}", stop_after=10)
    with pytest.raises(SceneError, match=f"solver.symmetry = '?{after}") as caught:
        run(tmp_path, f"solver.symmetry={after}")
    assert f"'{before}'" in str(caught.value)


def test_a_run_of_a_version_without_symmetry_goes_on_without(tmp_path, monkeypatch):
    run(tmp_path / "whole", "solver.symmetry=none")
    run(tmp_path / "old", "solver.symmetry=none", stop_after=20)

    def older(head):
        assert head.pop("mirror") == ""
        head["scene"] = re.sub('symmetry = "none"\n', "", head["scene"])
        return head

    read = checkpoint_file.read_head
    monkeypatch.setattr(resume, "read_head", lambda path: older(checkpoint_layout.read_head(path)))
    monkeypatch.setattr(checkpoint_file, "read_head", lambda path, comm: older(read(path, comm)))
    run(tmp_path / "old")
    monkeypatch.undo()
    assert not differences(tmp_path / "whole", tmp_path / "old")
