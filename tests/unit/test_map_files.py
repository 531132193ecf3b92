"""What is read from the files that people have: the same heights from each, or a refusal that names the cure."""

import subprocess
import sys

import numpy as np
import pytest

from pgfmd.errors import SceneError
from pgfmd.maps.reading import read_map
from pgfmd.scene import scene_from_mapping
from pgfmd.scene_objects import confirm, topography_of

from .map_files import COUNT, SIZE, classic, hdf5, lopsided, matrix, middles, sphere, table

SIZES = {"file_size": ["840 um", "840 um"]}
HEAD = "# Channel: Height\n# Width: 840.0 µm\n# Height: 840.0 µm\n# Value units: µm\n"
KEYENCE = '"Measured","2024"\r\n"XY Calibration","35000","nm"\r\n"Height","","µm"\r\n\r\n'
UP, DOWN = {"file_peaks": "up"}, {"file_peaks": "down"}


def scene_of(folder, name, radius="375 um", **keys):
    """A scene whose punch is a map, as people write them."""
    punch = {"pattern": "file", "file": name, "radius": radius} | keys
    return scene_from_mapping(
        {
            "punch": {key: value for key, value in punch.items() if value is not None},
            "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495, "boundary": "free"},
            "rheology": {"model": "elastic"},
            "adhesion": {"work_of_adhesion": "50 mJ/m^2"},
            "drive": {"speed": "100 um/s", "preload": "10 mN"},
            "grid": {"n": 64, "length": "1.5 mm"},
            "solver": {"scheme": "quasistatic"},
        },
        folder=folder,
    )


def face_of(folder, name, **keys):
    scene = scene_of(folder, name, **keys)
    confirm(scene, "test")
    return topography_of(scene.punch)


def refusals(folder, name, **keys):
    """The problems of a scene by their keys, as texts."""
    with pytest.raises(SceneError) as caught:
        face_of(folder, name, **keys)
    return {problem.key: str(problem) for problem in caught.value.problems}


def with_holes(path, code=np.nan, **options):
    """Five pixels without a height, in a map above a stage."""
    z = 1e6 * (20e-6 + sphere())
    for row, column in ((12, 12), (10, 14), (15, 9), (8, 11), (13, 17)):
        z[row, column] = code
    matrix(path, z, **options)


def counted(path):
    """A matrix with its rows and columns counted, as a data frame is written."""
    z = 1e6 * sphere()
    rows = [",".join(["", *map(str, range(COUNT))])]
    rows += [f"{at}," + ",".join(f"{number:.9g}" for number in row) for at, row in enumerate(z)]
    path.write_text("\n".join(rows))


def placed(path):
    """A matrix with places in its first row and column."""
    at, z = 1e6 * middles(COUNT, SIZE), 1e6 * sphere()
    rows = ["y\\x;" + ";".join(f"{place:.9g}" for place in at)]
    rows += [f"{place:.9g};" + ";".join(f"{number:.9g}" for number in row) for place, row in zip(at, z, strict=True)]
    path.write_text("\n".join(rows))


def gnuplot(path, corner):
    """A matrix with places around a corner that counts the columns, y from the top, as gnuplot's "nonuniform" has it."""
    at, z = 1e6 * middles(COUNT, SIZE), 1e6 * sphere()
    np.savetxt(path, np.block([[np.array([[float(corner)]]), at[None]], [at[::-1, None], z[::-1]]]))


def geographic(path):
    matrix(
        path,
        1e6 * sphere(),
        " ",
        head="ncols 24\nnrows 24\nxllcorner 0.0\nyllcorner 0.0\ncellsize 35\nNODATA_value -9999\n",
    )


def shuffled(path):
    order = np.random.default_rng(1).permutation(COUNT**2)
    table(path, sphere(), (SIZE, SIZE), "X [µm]\tY [µm]\tZ [nm]\n", "\t", (1e6, 1e6, 1e9), order)


def beyond(path):
    x = middles(COUNT, SIZE)
    np.save(path, np.where(np.hypot(x, x[:, None]) > 0.42e-3, np.nan, sphere()))


READ = {
    "metres.csv": (lambda path: matrix(path, sphere()), SIZES),
    "micrometres.csv": (lambda path: matrix(path, 1e6 * sphere()), SIZES | {"file_unit": "um"}),
    "counts.npy": (lambda path: np.save(path, np.round(4e9 * sphere()).astype(np.int32)), SIZES | {"file_unit": "0.25 nm"}),
    "header.txt": (lambda path: matrix(path, 1e6 * sphere(), " ", head=HEAD), {}),
    "header-latin.txt": (lambda path: matrix(path, 1e6 * sphere(), " ", head=HEAD, coding="cp1252"), {}),
    "keyence.csv": (lambda path: matrix(path, 1e6 * sphere(), head=KEYENCE), {}),
    "semicolons.csv": (lambda path: matrix(path, sphere(), ";", comma=True), SIZES),
    "commas-in-decimals.txt": (lambda path: matrix(path, 1e6 * sphere(), "  ", comma=True, head=HEAD), {}),
    "trailing.csv": (lambda path: matrix(path, sphere(), end=","), SIZES),
    "tabs.tsv": (lambda path: matrix(path, sphere(), "\t", end="\t"), SIZES),
    "counted.csv": (counted, SIZES | {"file_unit": "um"}),
    "placed.csv": (placed, SIZES | {"file_unit": "um"}),
    "gnuplot.txt": (lambda path: gnuplot(path, COUNT), SIZES | {"file_unit": "um"}),
    "geographic.asc": (geographic, SIZES | {"file_unit": "um"}),
    "points.txt": (lambda path: table(path, sphere(), (SIZE, SIZE), factors=(1e6,) * 3), SIZES | {"file_unit": "um"}),
    "units.txt": (lambda path: table(path, sphere(), (SIZE, SIZE), "Units: um\n", factors=(1e6,) * 3), {}),
    "wide.csv": (lambda path: matrix(path, sphere(), fmt="%.6000f"), SIZES),
    "shuffled.xyz": (shuffled, {}),
    "peaks.npy": (lambda path: np.save(path, 5e-3 - sphere()), SIZES | UP),
    "all.npz": (lambda path: np.savez(path, z=-1e9 * sphere(), size=[SIZE] * 2, unit="nm", peaks="up"), {"file_peaks": None}),
    "classic.nc": (lambda path: classic(path, sphere(), (SIZE, SIZE)), {}),
    "four.nc": (lambda path: hdf5(path, sphere(), (SIZE, SIZE)), {}),
    "beyond.npy": (beyond, SIZES),
    "zeros.csv": (lambda path: with_holes(path, 0.0), SIZES | {"file_unit": "um", "file_missing": "fill"}),
    "codes.csv": (lambda path: with_holes(path, -32768.0), SIZES | {"file_unit": "um", "file_missing": "fill"}),
    "named.csv": (
        lambda path: with_holes(path, 33.0), SIZES | {"file_unit": "um", "file_missing": "fill", "file_missing_value": [33]}
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_the_same_face_from_any_file(tmp_path, name):
    write, keys = READ[name]
    write(tmp_path / name)
    face = face_of(tmp_path, name, **DOWN | keys)
    x = 0.9 * middles(40, 530e-6)
    x, y = np.meshgrid(x, x)
    # Bilinear between pixels, 35 um apart: up to 35^2/(4 R) too high; a filled pixel is a quarter of that off.
    found, exact = face.heights(x, y), (x**2 + y**2) / 1e-2
    limit = 35e-6**2 / 2e-2 * (4.0 if name in ("zeros.csv", "codes.csv", "named.csv") else 1.0)
    lowest = {"zeros.csv": 20e-6, "codes.csv": 20e-6, "named.csv": 20e-6, "peaks.npy": -5e-3}.get(name, 0.0)
    assert np.abs(found - lowest - exact).max() < 1.05 * limit + 1e-9
    if name not in ("beyond.npy", "zeros.csv", "codes.csv", "named.csv"):
        at = middles(COUNT, SIZE)[4:-4]
        np.testing.assert_allclose(face.heights(at, at[:, None]) - lowest, sphere()[4:-4, 4:-4], atol=0.2e-9)


def long(path):
    matrix(path, 1e-3 * sphere(), head="height map, z is in mm, pixels of 35 um\n")


def scattered(path):
    x = np.random.default_rng(2).uniform(-400, 400, (200, 2))
    np.savetxt(path, np.column_stack([x, (x**2).sum(axis=1) / 1e4]))


REFUSED = {
    # What neither file nor scene says.
    "peaks.npy": (lambda path: np.save(path, sphere()), SIZES, "file_peaks", 'file_peaks = "up" .* file_peaks = "down"'),
    "size.npy": (lambda path: np.save(path, sphere()), DOWN, "file_size", "as the file does not say it; add file_size ="),
    "unit.csv": (lambda path: matrix(path, 1e6 * sphere()), SIZES | DOWN, "file_unit", 'rise by .* m, .* add file_unit = "um"'),
    "nanometres.csv": (lambda path: matrix(path, 1e9 * sphere()), SIZES | DOWN, "file_unit", 'add file_unit = "nm"'),
    "words.csv": (
        lambda path: matrix(path, 1e-6 * sphere(), head="# values times 1e-6, scan 840 um, see the log for mm\n"),
        SIZES | DOWN, "file_unit", "words not understood: .*840 um",
    ),
    "volts.txt": (
        lambda path: matrix(path, sphere(), " ", head="# Width: 840 um\n# Height: 840 um\n# Value units: V\n"),
        DOWN, "file_unit", 'heights of the file are in "V"',
    ),
    "points.txt": (lambda path: table(path, sphere(), (SIZE, SIZE), factors=(1e6,) * 3), SIZES | DOWN, "file_unit", '"um"'),
    "points-sizeless.txt": (
        lambda path: table(path, sphere(), (SIZE, SIZE), factors=(1e6,) * 3), DOWN | {"file_unit": "um"}, "file_size",
        "840 x 840, without a unit; add file_size = ..840 um., .840 um",
    ),
    "cells.asc": (geographic, DOWN | {"file_unit": "um"}, "file_size", "840 x 840, without a unit"),
    "corner.txt": (lambda path: gnuplot(path, 3), SIZES | DOWN, "file", "as places along x and y do, around 3 in the corner"),
    "phase.txt": (lambda path: matrix(path, sphere(), " ", head="# Phase [deg]\n"), SIZES | DOWN, "file_unit", 'are in "deg"'),
    "volts.xyz": (
        lambda path: table(path, sphere(), (SIZE, SIZE), "x [um] y [um] Height [V]\n", factors=(1e6, 1e6, 1)),
        DOWN, "file_unit", 'are in "V"',
    ),
    # Sizes in another unit.
    "wide.npz": (lambda path: np.savez(path, z=sphere(), size=[840.0] * 2), DOWN, "file_size", "pixels are 35 m x 35 m"),
    "wide.npy": (lambda path: np.save(path, sphere()), {"file_size": ["96 mm", "96 mm"]} | DOWN, "file_size", "4 pixels across"),
    # Pixels that are missing.
    "holes.csv": (lambda path: with_holes(path), SIZES | DOWN, "file_missing", "5 of .* no height.* row 9, column 12.*fill"),
    "zeros.csv": (lambda path: with_holes(path, 0.0), SIZES | DOWN, "file_missing", "that hold 0 are taken for missing"),
    "bad.txt": (
        lambda path: path.write_text("\n".join(["1 2 3 BAD 5 6"] * 6)), SIZES | DOWN, "file_missing", "row 1, column 4"
    ),
    "no-height.npy": (lambda path: np.save(path, np.full((24, 24), np.nan)), SIZES | {"file_missing": "fill"} | DOWN,
                      "file_missing", "at least half"),
    # Other things than maps.
    "profile.txt": (lambda path: np.savetxt(path, np.column_stack([np.arange(99.0)] * 2)), SIZES | DOWN, "file", "two columns"),
    "scattered.txt": (scattered, SIZES | DOWN, "file", "on no grid: interpolate"),
    "two.csv": (
        lambda path: path.write_text("height\n" + "1,2,3,4\n" * 5 + "phase\n" + "1,2,3,4\n" * 5), SIZES | DOWN, "file", "one block"
    ),
    "word.csv": (lambda path: path.write_text("1,2,3,4\n" * 5 + "1,2,oops,4\n"), SIZES | DOWN, "file", "'oops' in it is no number"),
    "rows.csv": (
        lambda path: path.write_text("".join(f"{row},0.5,0.25,0.125,0.5\n" for row in range(9))), SIZES | DOWN, "file", "counts"
    ),
    "three.npy": (lambda path: np.save(path, np.zeros((9, 9, 3))), SIZES | DOWN, "file", "shape"),
    "picture.png": (lambda path: path.write_bytes(b"\x89PNG"), SIZES | DOWN, "file", "picture"),
    "uneven.txt": (
        lambda path: np.savetxt(path, [(x, y, 1.0) for x in (0, 1, 2, 3.3, 4) for y in range(5)]), DOWN, "file", "on no grid"
    ),
    "many.h5": (lambda path: hdf5_of_two(path), SIZES | DOWN, "file", "holds a, b; expected"),
}  # fmt: skip


def hdf5_of_two(path):
    import h5py

    with h5py.File(path, "w") as file:
        file["a"], file["b"] = np.zeros((5, 5)), np.zeros((5, 5))


@pytest.mark.parametrize("name", REFUSED)
def test_what_may_be_another_thing_is_refused_with_the_cure(tmp_path, name):
    import re

    write, keys, key, words = REFUSED[name]
    write(tmp_path / name)
    found = refusals(tmp_path, name, **keys)
    assert set(found) == {f"punch.{key}"} and re.search(words, found[f"punch.{key}"]), found


def test_all_that_is_unsaid_is_told_at_once(tmp_path):
    matrix(tmp_path / "map.csv", 1e6 * sphere())
    assert set(refusals(tmp_path, "map.csv", **SIZES)) == {"punch.file_peaks", "punch.file_unit"}
    assert set(refusals(tmp_path, "map.csv")) == {"punch.file_peaks", "punch.file_size"}
    with pytest.raises(SceneError, match=r'punch.file_unit = .lb.: expected a unit of length, such as "um"'):
        scene_of(tmp_path, "map.csv", file_unit="lb", **SIZES)


@pytest.mark.parametrize("kind", ["npy", "csv", "xyz", "nc-x-first", "nc-y-first", "h5", "h5-falling", "asc"])
def test_rows_go_along_x_and_up_along_y(tmp_path, kind):
    """A map that is unlike its mirror images and its transpose, with sides that differ."""
    z, size, path = lopsided(), (900e-6, 800e-6), tmp_path / f"map.{kind.partition('-')[0]}"
    writers = {
        "npy": lambda: np.save(path, z),
        "csv": lambda: matrix(path, z),
        "xyz": lambda: table(path, z, size),
        "nc-x-first": lambda: classic(path, z, size, first="x"),
        "nc-y-first": lambda: classic(path, z, size),
        "h5": lambda: hdf5(path, z, size),
        "h5-falling": lambda: hdf5(path, z, size, falling=True),
        # Geographic grids begin in the north.
        "asc": lambda: matrix(path, z[::-1], " ", head="ncols 30\nnrows 20\nxllcorner 0\nyllcorner 0\ncellsize 3e-5\n"),
    }
    writers[kind]()
    own = kind in ("npy", "csv", "xyz", "asc")
    keys = DOWN | {"file_unit": "m" if own else None}
    face = face_of(tmp_path, path.name, file_size=["900 um", "800 um"] if own else None, **keys)
    assert face.map.size == pytest.approx(size, rel=1e-8)
    x, y = middles(30, size[0])[3:-3], middles(20, size[1])[3:-3]
    np.testing.assert_allclose(face.heights(x, y[:, None]), z[3:-3, 3:-3], atol=1e-14)


def test_what_missing_pixels_are_filled_with_is_between_their_neighbours(tmp_path):
    x, y = middles(40, 1e-3), middles(40, 1e-3)[:, None]
    plane = 2e-3 * x - 1e-3 * y
    holes = np.zeros((40, 40), bool)
    holes[10:16, 12:20] = holes[25, 30] = holes[20:22, 20] = True
    np.save(tmp_path / "map.npy", np.where(holes, np.nan, plane))
    keys = {"file_size": ["1 mm", "1 mm"], "file_missing": "fill"} | DOWN
    found = face_of(tmp_path, "map.npy", **keys).map
    # A plane solves Laplace's equation.
    np.testing.assert_allclose(found.heights, plane, atol=1e-15)
    assert found.facts.missing == np.count_nonzero(holes)
    rough = np.random.default_rng(3).normal(size=(40, 40)) * 1e-6
    np.save(tmp_path / "map.npy", np.where(holes, np.nan, rough))
    filled = face_of(tmp_path, "map.npy", **keys).map.heights
    np.testing.assert_array_equal(filled[~holes], rough[~holes])
    around = rough[9:17, 11:21][~holes[9:17, 11:21]]
    assert around.min() <= filled[10:16, 12:20].min() and filled[10:16, 12:20].max() <= around.max()


@pytest.mark.parametrize("detrend", ["tilt", "curvature"])
def test_what_is_taken_off_is_fitted_under_the_punch(tmp_path, detrend):
    x, y = middles(50, 1e-3), middles(60, 1.2e-3)[:, None]
    rough = 1e-7 * np.sin(7e4 * x) * np.cos(9e4 * y)
    trend = 1e-6 + 3e-3 * x - 2e-3 * y
    if detrend == "curvature":
        trend = trend + x**2 / 0.02 - y**2 / 0.03 + x * y / 0.04
    # What lies beyond the punch does not count, nor what is filled: the trend goes on across a gap at the rim.
    far = np.where(np.hypot(x, y) > 0.45e-3, 50e-6, np.where((x > 0.2e-3) & (abs(y) < 60e-6), np.nan, 0.0))
    np.save(tmp_path / "map.npy", rough + trend + far)
    keys = {"file_size": ["1 mm", "1.2 mm"], "file_detrend": detrend, "file_missing": "fill"} | DOWN
    face = face_of(tmp_path, "map.npy", **keys)
    at = middles(30, 400e-6)
    np.save(tmp_path / "rough.npy", rough + np.where(np.isnan(far), np.nan, 0.0))
    level = face_of(tmp_path, "rough.npy", **keys)
    np.testing.assert_allclose(face.heights(at, at[:, None]), level.heights(at, at[:, None]), atol=1e-14)


def test_a_map_is_read_once_and_anew_when_its_file_has_changed(tmp_path, monkeypatch):
    np.save(tmp_path / "map.npy", sphere())
    scene, reads = scene_of(tmp_path, "map.npy", **SIZES | DOWN), []
    monkeypatch.setattr("pgfmd.maps.reading.read_map", lambda path: reads.append(path) or read_map(path))
    for _ in range(3):
        confirm(scene, "test")
    assert len(reads) == 1
    np.save(tmp_path / "map.npy", sphere(25))
    assert topography_of(scene.punch).map.heights.shape == (25, 25) and len(reads) == 2


def test_a_check_of_an_hdf5_map_loads_neither_mpi_nor_hdf5(tmp_path):
    hdf5(tmp_path / "map.h5", sphere(), (SIZE, SIZE))
    program = (
        "import sys; from pgfmd.maps.reading import read_map; found = read_map(sys.argv[1]);"
        "print(found.numbers.shape, found.size, *({'mpi4py', 'h5py'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "map.h5")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    assert done.stdout.startswith("(24, 24) (8") and done.stdout.strip().endswith(")")
