"""The punch as a solid and as a height map: closed surfaces, heights that read back, formats as others read them."""

import hashlib
import importlib.util
import io
import math
import tomllib
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from scipy.io import netcdf_file
from scipy.ndimage import binary_dilation

import pgfmd
from pgfmd import Scene, cli
from pgfmd.errors import PgfmdError, ResultError
from pgfmd.punch.face import face_on_grid
from pgfmd.punch.solid import solid_of
from pgfmd.scene_objects import confirm, topography_of

TRI = Scene("tri-tack", grid={"n": 64})
LAYERED = TRI.replace(punch={"curvature_radius": 5e-3, "layer_step": 2e-7})
ROUGH = Scene(
    "tri-tack", grid={"n": 64},
    punch={"pattern": "rough", "hurst": 0.8, "longest": 3e-4, "shortest": 6e-5, "rms_height": 1e-6},
)  # fmt: skip
FILLED = Scene("tri-tack", grid={"n": 20}, punch={"pattern": "sinusoid", "radius": None, "wavelength": 5e-4})


def mesh_of(scene, tmp_path, **options):
    path = tmp_path / "punch.stl"
    pgfmd.export_punch(scene, path, force=True, **options)
    return trimesh.load_mesh(path)


@pytest.mark.parametrize("n", [8, 9, 40, 63, 64, 90])
def test_a_solid_is_closed_and_has_the_volume_of_its_disc(tmp_path, n):
    scene = Scene("flat-punch", grid={"n": n})
    mesh = mesh_of(scene, tmp_path, height=1e-3)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1
    radius, spacing = 1e3 * scene.punch.radius, 1e3 * scene.grid.length / n
    assert mesh.extents[2] == pytest.approx(1.0)
    # A polygon within the circle: its sides are no longer than a diagonal of the grid.
    assert abs(1 - mesh.volume / (math.pi * radius**2)) < (spacing / radius) ** 2
    assert np.hypot(*mesh.vertices.T[:2]).max() == pytest.approx(radius, rel=1e-3 if n > 9 else 0.05)


@pytest.mark.parametrize(
    "scene", [TRI, LAYERED, ROUGH, FILLED], ids=["tri", "layered and curved", "rough", "whole cell"]
)
def test_a_solid_has_the_heights_of_the_face_turned_face_up(tmp_path, scene):
    mesh = mesh_of(scene, tmp_path, height=2e-3)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    assert mesh.bounds[:, 2] == pytest.approx([-2.0, 0.0], abs=1e-9)
    x, y, z = mesh.vertices[mesh.vertices[:, 2] > -1.9].T * 1e-3
    heights = topography_of(scene.punch).heights(x, -y)
    error = -z - (heights - heights.min())
    # Single precision: a thousandth of the layers, and far less than the relief.
    assert np.abs(error).max() < 3e-10
    face = face_on_grid(scene)
    assert len(x) >= face.inside.sum()
    # Not its mirror image, where it has one of its own.
    mirrored = topography_of(scene.punch).heights(x, y)
    assert scene is FILLED or np.abs(mirrored - heights).max() > 0.2 * face.relief


def test_a_solid_is_magnified_but_not_its_height():
    small, large = solid_of(TRI, 5e-3), solid_of(TRI, 5e-3, 10.0)
    face = small.points[:, 2] > -4.9e-3
    np.testing.assert_allclose(large.points[face], 10 * small.points[face], rtol=1e-12, atol=1e-18)
    assert large.size[2] == pytest.approx(5e-3) == small.size[2]
    assert solid_of(TRI).size[2] == pytest.approx(TRI.punch.radius, rel=0.01)
    with pytest.raises(PgfmdError, match="--height 50 um: the solid has to reach below its face"):
        solid_of(TRI, 5e-5, 10.0)
    with pytest.raises(PgfmdError, match=r"coarser grid, such as grid\.n=5792"):
        solid_of(TRI.replace(grid={"n": 32768}))


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".xyz", ".x3p", ".nc"])
@pytest.mark.parametrize("scene", [LAYERED, FILLED], ids=["outline", "whole cell"])
def test_a_map_holds_the_heights(tmp_path, suffix, scene):
    path = tmp_path / f"face{suffix}"
    pgfmd.export_punch(scene, path, peaks="down")
    face = face_on_grid(scene, margin=1)
    step = face.spacing
    if suffix == ".npy":
        z = np.load(path)
    elif suffix == ".npz":
        z, size = (np.load(path)[name] for name in ("z", "size"))
        assert tuple(size) == face.size and (np.load(path)["unit"], np.load(path)["peaks"]) == ("m", "down")
    elif suffix == ".xyz":
        x, y, z = (column.reshape(face.z.shape) for column in np.loadtxt(path, skiprows=1).T)
        np.testing.assert_allclose(x[0], face.x, rtol=0, atol=1e-12 * step)
        np.testing.assert_allclose(y[:, 0], face.y, rtol=0, atol=1e-12 * step)
    elif suffix == ".nc":
        with netcdf_file(path, mmap=False) as file:
            z = file.variables["heights"][:].T
            np.testing.assert_allclose(file.variables["x"][:], face.x, rtol=0, atol=1e-9 * step)
            assert file.variables["y"].length == face.size[1] and file.variables["x"].unit == b"m"
            assert file.variables["heights"].peaks == b"down"
            assert bool(file.variables["x"].periodic) == (scene is FILLED)
    else:
        z = read_x3p(path, step)
    np.testing.assert_array_equal(z, face.z)


def read_x3p(path, step):
    """The heights of an x3p file, whose description and checksums are looked at."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("main.xml"))
        data = archive.read(root.findtext("Record3/DataLink/PointDataLink"))
        checksum = archive.read(root.findtext("Record4/ChecksumFile")).split()[0].decode()
        assert hashlib.md5(archive.read("main.xml")).hexdigest().upper() == checksum
    assert root.tag == "{http://www.opengps.eu/2008/ISO5436_2}ISO5436_2"
    assert hashlib.md5(data).hexdigest().upper() == root.findtext("Record3/DataLink/MD5ChecksumPointData")
    assert [root.findtext(f"Record1/Axes/C{axis}/AxisType") for axis in "XYZ"] == ["I", "I", "A"]
    assert float(root.findtext("Record1/Axes/CX/Increment")) == pytest.approx(step)
    columns, rows = (int(root.findtext(f"Record3/MatrixDimension/Size{axis}")) for axis in "XY")
    return np.frombuffer(data, "<f8").reshape(rows, columns)


@pytest.mark.skipif(importlib.util.find_spec("SurfaceTopography") is None, reason="SurfaceTopography is not installed")
@pytest.mark.parametrize("suffix", [".x3p", ".nc", ".xyz"])
def test_surface_topography_reads_a_map(tmp_path, suffix):
    from SurfaceTopography import read_topography

    path = tmp_path / f"face{suffix}"
    pgfmd.export_punch(LAYERED, path, peaks="up")
    found, face = read_topography(str(path)), face_on_grid(LAYERED, margin=1)
    np.testing.assert_allclose(found.heights(), -face.z.T, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(found.physical_sizes, face.size, rtol=1e-9)
    assert found.unit == "m" or suffix == ".xyz"


@pytest.mark.parametrize("peaks", [None, "down", "up"])
@pytest.mark.parametrize(
    ("suffix", "scene"),
    [(".npy", LAYERED), (".npz", LAYERED), (".xyz", LAYERED), (".nc", LAYERED), (".npz", FILLED), (".npy", ROUGH)],
)
def test_a_map_reads_back_by_the_keys_that_are_told(tmp_path, suffix, scene, peaks):
    assert_reads_back(tmp_path / f"face{suffix}", scene, peaks)


@pytest.mark.skipif(importlib.util.find_spec("SurfaceTopography") is None, reason="SurfaceTopography is not installed")
def test_a_map_for_instruments_reads_back(tmp_path):
    assert_reads_back(tmp_path / "face.x3p", LAYERED, None)


def assert_reads_back(path, scene, peaks, **options):
    """That a scene with the file has the heights of the one that it was made of, to rounding."""
    done = pgfmd.export_punch(scene, path, peaks=peaks, **options)
    keys = tomllib.loads("\n".join(done.reading)) | {"file": str(path)}
    tables = {section: values for section, values in scene.tables().items() if section != "punch"}
    again = Scene(tables, punch=keys)
    confirm(again, "the scene with the file")
    face, found = face_on_grid(scene), face_on_grid(again)
    np.testing.assert_allclose(found.z[face.inside], face.z[face.inside], rtol=0, atol=1e-12 * face.relief)
    if face.radius is not None:
        # A finer grid has points nearer to the rim, but none that the map does not reach.
        confirm(again.replace(grid={"n": 5 * scene.grid.n}), "the same on a finer grid")


def test_a_map_may_be_cut_and_turned_over(tmp_path):
    for name, options in (("cut", {"cut": True}), ("up", {"peaks": "up"})):
        pgfmd.export_punch(TRI, tmp_path / f"{name}.npy", **options)
    face, cut, up = face_on_grid(TRI, 1), np.load(tmp_path / "cut.npy"), np.load(tmp_path / "up.npy")
    # One pixel around the outline stays.
    ring = binary_dilation(face.inside, np.ones((3, 3)))
    assert face.inside.sum() < np.isfinite(cut).sum() <= ring.sum() < cut.size and not (np.isfinite(cut) & ~ring).any()
    np.testing.assert_array_equal(cut[face.inside], face.z[face.inside])
    np.testing.assert_array_equal(up, -face.z)
    pgfmd.export_punch(TRI, tmp_path / "cut.xyz", cut=True)
    assert len(np.loadtxt(tmp_path / "cut.xyz", skiprows=1)) == np.isfinite(cut).sum()


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".xyz", ".nc"])
def test_a_cut_map_reads_back(tmp_path, suffix):
    assert_reads_back(tmp_path / f"face{suffix}", LAYERED, None, cut=True)


def test_a_stamp_measured_face_up_is_said_to_be_mirrored(tmp_path):
    """The solid of its scene has the heights of the map at (x, -y); with the map's rows turned over it is the stamp."""
    x = (np.arange(24) + 0.5) * 1e-3 / 24 - 0.5e-3
    z = 1e-6 * (np.sin(5e3 * x + 1.0) + 2e3 * x[:, None])
    punch = {"pattern": "file", "file_size": [1e-3, 1e-3], "file_unit": "m", "radius": 3e-4}
    for name, rows, up in (("as-measured", z, -1.0), ("turned", z[::-1], 1.0)):
        np.save(tmp_path / f"{name}.npy", rows)
        scene = TRI.replace(punch=punch | {"file": str(tmp_path / f"{name}.npy"), "file_peaks": "up"})
        assert "mirror image" in pgfmd.export_punch(scene, tmp_path / f"{name}.stl").text
        face = topography_of(scene.punch)
        # What is at (x, y) of the solid is at (x, -y) of the scene.
        np.testing.assert_allclose(-face.heights(x[[9]], -up * x[[7]]), z[[7], [9]], atol=1e-15)
    down = scene.replace(punch={"file_peaks": "down"})
    assert "mirror image" not in pgfmd.export_punch(down, tmp_path / "down.stl").text


def test_what_an_export_refuses(tmp_path):
    np.save(tmp_path / "own.npy", np.zeros((4, 4)))
    own = TRI.replace(punch={"pattern": "file", "file": str(tmp_path / "own.npy"), "file_size": [1e-3, 1e-3]})
    for scene, name, options, word in (
        (TRI, "a.obj", {}, "expected a name that ends in .stl, .npy"),
        (TRI, "a.stl", {"peaks": "up"}, "are for maps"),
        (TRI, "a.npy", {"magnify": 2.0}, "are for a solid"),
        (TRI, "a.stl", {"magnify": -1.0}, "expected a positive number"),
        (own, "own.npy", {"force": True}, "is the map that the scene's face is read from"),
    ):
        with pytest.raises(PgfmdError, match=word):
            pgfmd.export_punch(scene, tmp_path / name, **options)
    pgfmd.export_punch(TRI, tmp_path / "a.npy")
    with pytest.raises(ResultError, match="exists already"):
        pgfmd.export_punch(TRI, tmp_path / "a.npy")


def run(*arguments):
    with pytest.raises(SystemExit) as caught:
        cli.main(list(map(str, arguments)))
    return caught.value.code


def test_the_commands(tmp_path, capsys):
    solid, face, picture = tmp_path / "punch.stl", tmp_path / "face.nc", tmp_path / "face.pdf"
    assert run("export", "tri-tack", solid, "grid.n=32", "--height", "2mm", "--magnify", "10") == 0
    assert "x 2 mm, 10 times the punch" in capsys.readouterr().out
    mesh = trimesh.load_mesh(solid)
    assert mesh.is_watertight and mesh.extents == pytest.approx([7.5, 7.5, 2.0], rel=0.01)
    assert run("export", "tri-tack", face, "grid.n=32") == 0
    assert 'pattern = "file"' in capsys.readouterr().out
    assert run("export", "tri-tack", face, "grid.n=32") == 4
    assert run("export", "tri-tack", solid, "--magnify", "0") == 2
    assert run("show", "hex-tack", "grid.n=32", "-o", picture) == 0
    assert picture.read_bytes().startswith(b"%PDF")
    assert run("show", "hex-tack", "grid.n=32", "-o", tmp_path / "face.doc") == 4


def test_a_picture_of_the_face_shows_the_first_contact():
    figure = pgfmd.plot_punch(ROUGH)
    face = face_on_grid(ROUGH)
    row, column = face.first_contact()
    assert face.z[row, column] == 0.0 == face.z[face.inside].min()
    mark = figure.axes[0].lines[0]
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == pytest.approx((1e6 * face.x[column], 1e6 * face.y[row]))
    profile = figure.axes[2].lines[0].get_ydata()
    np.testing.assert_allclose(profile[face.inside[row]], 1e6 * face.z[row][face.inside[row]])
    shares = [bar.get_height() for bar in figure.axes[3].patches]
    assert sum(shares) == pytest.approx(100.0)
    file = io.BytesIO()
    pgfmd.plot_punch(FILLED).savefig(file, format="png")
    pgfmd.plot_punch(Scene("flat-punch", grid={"n": 16})).savefig(file, format="png")
