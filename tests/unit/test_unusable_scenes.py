"""Scenes, maps and paths that can't be used end in a message with key and cure, never in a traceback or a warning."""

import io
import os
import struct
import warnings
import zipfile

import numpy as np
import pytest

from pgfmd.errors import SceneError
from pgfmd.forecast import advice
from pgfmd.parts import confirm
from pgfmd.scene import load_scene, parse_scene

SIZE = 'punch.file_size=["900 um", "900 um"]'


def checked(*overrides, name="tri-tack", **options):
    """The scene after all that `check` looks at."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = load_scene(name, overrides, **options)
        confirm(scene, name)
        list(advice.warnings(scene)), list(advice.remarks(scene))
    return scene


def refusal(*overrides, **options):
    """The one problem of a scene."""
    with pytest.raises(SceneError) as caught:
        checked(*overrides, **options)
    (problem,) = caught.value.problems
    return problem


# Height maps ---------------------------------------------------------------------------------------------------------


def npy(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def npz(**arrays):
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def absurd_header():
    text = b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000, 100000), }"
    text += b" " * (118 - len(text)) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


def archive_of(content):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("z.npy", content)
    return file.getvalue()


WHOLE = npy(np.zeros((24, 24)))
UNUSABLE = {
    "empty.npy": (b"", "magic"),
    "cut.npy": (WHOLE[:500], ""),
    "garbage.npy": (b"garbage" * 9, "magic"),
    "absurd.npy": (absurd_header(), "memory"),
    "objects.npy": (npy(np.array([[{}, 1], [2, 3]], dtype=object)), "allow_pickle"),
    "complex.npy": (npy(np.ones((4, 4)) * 1j), "real numbers"),
    "text.npy": (npy(np.array([["a", "b"], ["c", "d"]])), "real numbers"),
    "dates.npy": (npy(np.zeros((4, 4), "M8[s]")), "real numbers"),
    "line.npy": (npy(np.zeros(9)), "shape"),
    "nan.npy": (npy(np.full((4, 4), np.nan)), "not finite"),
    "high.npy": (npy(np.full((4, 4), 1e300)), "in metres"),
    "empty.npz": (b"", "archive"),
    "cut.npz": (npz(z=np.zeros((24, 24)))[:500], "archive"),
    "junk.npz": (b"PK\003\004junk", "archive"),
    "nothing.npz": (npz(a=np.zeros((4, 4))), "array named z"),
    "member.npz": (archive_of(b"junk"), ""),
    "size.npz": (npz(z=np.zeros((4, 4)), size=1.0), "size"),
    "empty.csv": (b"", "no numbers"),
    "binary.csv": (b"\x00\x81\x00", "not a text file"),
    "words.csv": (b"a,b\nc,d\n", "could not convert"),
    "ragged.csv": (b"1,2\n3\n", "columns"),
    "empty.txt": (b"# nothing\n", "no numbers"),
    "unknown.tif": (b"II*\0", "unknown kind"),
}


@pytest.mark.parametrize("name", UNUSABLE)
def test_an_unusable_map_is_told_with_its_reason(name, tmp_path):
    content, words = UNUSABLE[name]
    (tmp_path / name).write_bytes(content)
    size = [] if name == "size.npz" else [SIZE]
    problem = refusal("punch.pattern=file", f"punch.file={tmp_path / name}", *size)
    assert (problem.key, problem.expected) == ("punch.file", "a usable topography")
    assert name in problem.cure or "height map" in problem.cure
    assert words in problem.cure


@pytest.mark.parametrize("coding", ["utf-8-sig", "utf-16", "cp1252"])
def test_scene_map_and_compliance_may_have_a_mark_or_be_latin(coding, tmp_path):
    (tmp_path / "h.csv").write_bytes("# Höhe in m\r\n1e-7,2e-7\r\n3e-7,4e-7\r\n".encode(coding))
    (tmp_path / "g.txt").write_bytes("# Nachgiebigkeit, µ\n1e2 1e-8\n1e9 1e-15\n".encode(coding))
    text = load_scene("tri-tack", ["title="]).to_toml().replace("[substrate]", '[substrate]\ncompliance_file = "g.txt"')
    (tmp_path / "s.toml").write_bytes(f'title = "Stempel, 4 µm"\n{text}'.encode(coding))
    scene = checked("punch.pattern=file", "punch.file=h.csv", SIZE, name=tmp_path / "s.toml")
    assert scene.title == "Stempel, 4 µm" and scene.substrate.compliance_file == str(tmp_path / "g.txt")


@pytest.mark.parametrize(
    "content", [b"", b"\x00\x81", b"1 2 3\n4 5 6\n", b"a b\n", b"1e2 1e-8\n1e2 1e-9\n", b"1e2 inf\n"]
)
def test_an_unusable_compliance_is_told(content, tmp_path):
    (tmp_path / "g.txt").write_bytes(content)
    problem = refusal(f"substrate.compliance_file={tmp_path / 'g.txt'}")
    assert problem.key == "substrate.compliance_file"


@pytest.mark.parametrize("rows", ["1e2 1e-8\n1e4 1e-10\n", "1e4 1e-8\n1e6 1e-10\n"])
@pytest.mark.parametrize("scheme", ["inertialess", "gfmd"])
def test_a_compliance_that_ends_within_the_waves_of_the_grid_is_refused_before_a_run(rows, scheme, tmp_path):
    (tmp_path / "g.txt").write_text(rows)
    problem = refusal(f"substrate.compliance_file={tmp_path / 'g.txt'}", "grid.n=64", f"solver.scheme={scheme}")
    assert problem.key == "substrate.compliance_file" and "extend the table" in problem.cure
    assert "4188.79 to 189563 rad/m are needed" in problem.cure


def test_a_map_that_ends_before_the_punch_is_refused_before_a_run(tmp_path):
    np.save(tmp_path / "m.npy", np.zeros((8, 8)))
    named = ["punch.pattern=file", f"punch.file={tmp_path / 'm.npy'}"]
    problem = refusal(*named, 'punch.file_size=["900 um", "600 um"]')
    assert problem.key == "punch.file" and "less than the punch" in problem.cure
    checked(*named, 'punch.file_size=["750 um", "750 um"]')
    # Where n is odd the outermost points are on the axes, and there may be one alone.
    spacing = 1.5e-3 / 33
    for radius in (8.0, 8.01):
        odd = (*named, "grid.n=33", f"punch.radius={radius * spacing!r} m")
        assert refusal(*odd, f'punch.file_size=["{15.9 * spacing!r} m", "1 mm"]').key == "punch.file"
        checked(*odd, f'punch.file_size=["{16.1 * spacing!r} m", "1 mm"]')


# Numbers that can't be computed with ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("grid.length=1 dB", "not known"),
        ("grid.length=1e99999999999999999999 m", "finite"),
        ("substrate.thickness=1e400 m", "finite"),
        ("adhesion.range=1e-200 m", "at least 1e-30 and at most 1e+30 m"),
        ("adhesion.q_ref=5e-324 1/m", "at least 1e-30 and at most 1e+30 1/m"),
        ("adhesion.range_factor=1e300", "at least 1e-30 and at most 1e+30"),
        ("drive.clearance=-1e100 m", "must be at most 1e+30 m"),
        ("rheology.modulus_ratio=0,5", 'decimal point, "0.5"'),
        ("grid.n=" + "9" * 5000, ""),
        ("grid.n=0x" + "f" * 5000, ""),
        ("title=" + "[" * 3000, None),
    ],
)
def test_a_number_beyond_computing_is_refused_by_its_key(override, words):
    if words is None:
        assert checked(override).title.startswith("[[[")
        return
    problem = refusal(override)
    assert problem.key == override.partition("=")[0] and words in f"{problem.expected} {problem.cure}"
    assert len(str(problem)) < 1000


def test_automatic_values_are_held_to_the_limits_of_given_ones():
    with pytest.raises(SceneError) as caught:
        checked("adhesion.work_of_adhesion=1e-30 J/m^2", "substrate.youngs_modulus=1e30 Pa", "adhesion.q_ref=1e29 1/m")
    found = [problem.key for problem in caught.value.problems]
    assert found == ["adhesion.range", "drive.turn_time"]
    assert "look at their units" in str(caught.value)


def test_a_profile_without_end_is_refused():
    keys = ["punch.pattern=power", "punch.exponent=200", "punch.curvature_radius=1 nm"]
    assert refusal(*keys).key == "punch.pattern"


def test_a_series_of_zeros_does_not_relax():
    series = ["rheology.model=prony", "rheology.kappa=[0.0]", 'rheology.tau=["1 s"]', "solver.scheme=gfmd"]
    with pytest.raises(SceneError, match=r"solver\.gfmd\.omega = .missing.: expected both omega and dt"):
        checked(*series)
    checked(*series, "solver.gfmd.omega=1570 rad/s", "solver.gfmd.dt=20 us")


def test_toml_without_end_is_refused():
    for text in ("a = " + "[" * 9000, "a = " + "9" * 5000, "a = {b = " * 9000):
        with pytest.raises(SceneError, match="valid TOML"):
            parse_scene(text)


# Paths ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["punch.file", "substrate.compliance_file", "output.directory"])
def test_paths_that_cannot_be_are_refused(key, tmp_path):
    base = ["punch.pattern=file", SIZE] if key == "punch.file" else []
    assert "no home folder ~nosuchuser" in refusal(*base, f"{key}=~nosuchuser/x.npy").cure
    assert "code 0" in refusal(*base, f'{key}="a\\u0000b"').cure
    assert "rename" in refusal(*base, f"{key}={tmp_path / os.fsdecode(b'a' + bytes([255]))}").cure
    if key != "output.directory":
        assert "is a folder" in refusal(*base, f"{key}={tmp_path}").cure


def test_a_title_that_is_no_unicode_is_refused():
    assert refusal("title=" + os.fsdecode(b"\xff")).key == "title"


def test_a_problem_stays_on_one_line(tmp_path):
    with pytest.raises(SceneError) as error:
        load_scene("tri-tack", [f"punch.file={tmp_path}/a\nb.npy", "punch.pattern=file"])
    assert all("a\\nb.npy" in str(problem) and "\n" not in str(problem) for problem in error.value.problems[:1])
