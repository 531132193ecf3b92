"""The resolved scene of a run: it loads, whatever was asked for, to the same scene and to the same bits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI

from pgfmd.errors import SceneError
from pgfmd.files.storage import SCENE_FILE
from pgfmd.restart.sameness import differences
from pgfmd.restart.scene_changes import differing
from pgfmd.results.status import status_of
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene, parse_scene, scene_from_mapping
from tests.unit.small_runs import SCENE, run

FIXED = settings(derandomize=True, database=None, deadline=None, max_examples=60)

# Any scene ----------------------------------------------------------------------------------------------------------


def quantities(unit, least, most):
    return st.floats(least, most).map(lambda value: f"{value!r} {unit}")


def table(required=None, **optional):
    return st.fixed_dictionaries(required or {}, optional=optional)


LENGTH = quantities("um", 1e-3, 1e3)
ONE, TIME, SPEED = st.floats(0.5, 2.0), quantities("ms", 1e-6, 1e6), quantities("um/s", 1e-3, 1e6)
WAVE = {"wavelength": st.sampled_from(["150 um", "0.3 mm"]), "amplitude": LENGTH}
AXIS = {"radius": quantities("um", 200.0, 375.0)}
EXTRAS = {"layer_step": LENGTH, "curvature_radius": quantities("mm", 1.0, 1e6)}
JITTER = {"height_jitter": LENGTH, "seed": st.integers(0, 2**63 - 1)}


def punch(pattern, required, **optional):
    return table({"pattern": st.just(pattern)} | required, **optional)


PUNCHES = st.one_of(
    *(punch(pattern, WAVE | AXIS, **EXTRAS, **JITTER) for pattern in ("triangular", "hexagonal", "sinusoid")),
    punch("flat", AXIS, **EXTRAS),
    punch("sphere", AXIS | {"curvature_radius": LENGTH}, layer_step=LENGTH),
    punch("power", AXIS | {"curvature_radius": LENGTH, "exponent": st.floats(1.1, 9.0)}, layer_step=LENGTH),
    punch(
        "file",
        {"file": st.just("a map.npy")},
        file_size=st.just(["1.5 mm", "2 mm"]),
        file_relief=LENGTH,
        file_unit=st.sampled_from(["um", "0.25 nm"]),
        file_peaks=st.sampled_from(["up", "down"]),
        file_detrend=st.sampled_from(["none", "tilt", "curvature"]),
        file_missing=st.sampled_from(["refuse", "fill"]),
        file_missing_value=st.just([0.0, -32768.0]),
        **AXIS,
    ),
)
SUBSTRATE = {"youngs_modulus": quantities("MPa", 1e-3, 1e4), "poisson_ratio": st.floats(-0.9, 0.5)}
SUBSTRATES = st.one_of(
    table(SUBSTRATE, thickness=st.just("inf"), prestrain=st.lists(ONE, min_size=2, max_size=2)),
    table(SUBSTRATE | {"thickness": LENGTH}, base=st.sampled_from(["bonded", "sliding"])),
    table(SUBSTRATE, compliance_file=st.just("own/compliance.txt")),
)
SINGLE = {"modulus_ratio": st.floats(1.5, 100.0), "relaxation_time": TIME}
SPECTRUM = {"elements": st.integers(1, 6), "time_ratio": st.floats(1.5, 9.0), "exponent": st.floats(0.0, 2.0)}
RHEOLOGIES = st.one_of(
    st.just({"model": "elastic"}),
    table({"model": st.just("single")} | SINGLE),
    table({"model": st.just("geometric")} | SINGLE | SPECTRUM),
    st.lists(st.tuples(st.just(0.0) | st.floats(1e-6, 9.0), TIME), min_size=1, max_size=4).map(
        lambda pairs: {"model": "prony", "kappa": [kappa for kappa, _ in pairs], "tau": [tau for _, tau in pairs]}
    ),
)
OWN = {"omega": quantities("rad/s", 1.0, 1e6), "dt": quantities("us", 1e-3, 1e3)}
STEPS = {"omega_tau": ONE, "steps_per_tau": st.floats(5.0, 99.0), "fast_pull": st.floats(1e-3, 0.1)}
STEPPING = st.one_of(table(OWN), table(**STEPS))
SOLVERS = st.one_of(
    table({"scheme": st.just("gfmd"), "gfmd": table(OWN)}, max_steps=st.integers(1, 10**12)),
    table(
        {"scheme": st.just("inertialess")}, order=st.sampled_from([1, 2]), accuracy=st.floats(1e-8, 0.3), gfmd=STEPPING
    ),
    table({"scheme": st.just("quasistatic")}, modulus=st.sampled_from(["relaxed", "instantaneous"]), gfmd=STEPPING),
)
SCENES = st.fixed_dictionaries(
    {
        "punch": PUNCHES,
        "substrate": SUBSTRATES,
        "rheology": RHEOLOGIES,
        "adhesion": table(
            {"work_of_adhesion": quantities("mJ/m^2", 1.0, 1e4)},
            law=st.sampled_from(["cosine", "repulsive"]),
            range=st.just("auto") | LENGTH,
            range_factor=ONE,
            q_ref=st.just("grid") | quantities("1/um", 0.1, 9.0),
        ),
        "drive": table(
            {"speed": SPEED, "preload": quantities("mN", 0.1, 99.0)},
            retract_speed=SPEED, dwell=TIME, turn_time=st.just("auto") | TIME, clearance=st.just("auto") | LENGTH,
        ),
        "grid": table({"n": st.integers(64, 512), "length": st.just("1.5 mm")}),
        "solver": SOLVERS,
        "output": table(
            snapshots=st.lists(st.one_of(TIME, ONE.map(lambda share: f"{share!r} t_pl")), max_size=3),
            every=st.integers(1, 1000), directory=st.text(st.characters(blacklist_categories=["Cs"]), min_size=1),
            surface=st.booleans(), energy=st.booleans(), patches=st.booleans(),
        ),
        "title": st.text(),
    }
)  # fmt: skip


@FIXED
@given(SCENES)
def test_a_resolved_scene_is_complete_and_loads_to_the_same_scene(mapping):
    try:
        scene = scene_from_mapping(mapping, require_files=False)
    except SceneError as error:
        refused = [problem.key for problem in error.problems]
    else:
        refused = []
    if refused:
        # A name for a folder is any text here.
        assert refused == ["output.directory"]
        return
    again = parse_scene(scene.to_toml(), require_files=False, folder="/elsewhere")
    assert again == scene and again.to_toml() == scene.to_toml()
    assert not list(differing(scene.to_toml(), again))


def test_what_gfmd_does_not_read_beside_omega_and_dt_may_stand_there_at_its_default():
    """As in the resolved scenes of version 0.1."""
    own = ["solver.scheme=gfmd", "solver.gfmd.omega=15700 rad/s", "solver.gfmd.dt=20 us"]
    scene = load_scene("tri-tack", own)
    assert "omega_tau" not in scene.to_toml()
    old = scene.to_toml().replace("[solver.gfmd]\n", "[solver.gfmd]\nfast_pull = 0.01\nomega_tau = 6.283185307179586\n")
    assert parse_scene(old) == scene and not list(differing(old, scene))
    with pytest.raises(SceneError, match=r"solver\.gfmd\.fast_pull = 0\.02: .* delete it"):
        load_scene("tri-tack", [*own, "solver.gfmd.fast_pull=0.02"])


def test_a_run_of_before_goes_on_with_the_way_that_heights_were_taken_to_grow(heights):
    old = load_scene(SCENE[0], [*SCENE[1:], *MAP[:2], f"punch.file={heights}"])
    assert "file_peaks" not in old.to_toml()
    now = {way: load_scene(SCENE[0], [*SCENE[1:], *MAP[:2], f"punch.file={heights}", f"punch.file_peaks={way}"])
           for way in ("down", "up")}  # fmt: skip
    assert not list(differing(old.to_toml(), now["down"]))
    assert [key for key, _, _ in differing(old.to_toml(), now["up"])] == ["punch.file_peaks"]


def test_keys_of_another_scheme_do_not_make_scenes_differ():
    scene = load_scene("tri-tack", ["solver.gfmd.fast_pull=0.02"])
    assert scene == load_scene("tri-tack") == parse_scene(scene.to_toml())


# Runs ---------------------------------------------------------------------------------------------------------------

GFMD = ("solver.scheme=gfmd", "solver.gfmd.omega=15700 rad/s", "solver.gfmd.dt=20 us", "drive.speed=1 mm/s")
MAP = ("punch.pattern=file", 'punch.file_size=["1 mm", "1 mm"]', "punch.file_peaks=down")


def arguments(path, steps=12):
    return *GFMD, *MAP, f"punch.file={path}", f"solver.max_steps={steps}"


@pytest.fixture
def heights(tmp_path):
    path = tmp_path / 'heights "of" a map é.npy'
    np.save(path, 1e-6 * np.add.outer(np.cos(np.arange(24) / 3), np.sin(np.arange(24) / 4)))
    return path


def test_a_resolved_scene_runs_to_the_same_bits(tmp_path, heights):
    first = run(tmp_path / "first", *arguments(heights))
    again = load_scene(first / SCENE_FILE)
    run_scene(again, MPI.COMM_SELF, tmp_path / "again", lambda line: None)
    assert not differences(first, tmp_path / "again")
    assert (first / SCENE_FILE).read_bytes() == (tmp_path / "again" / SCENE_FILE).read_bytes()


def test_a_run_goes_on_with_a_moved_map_and_an_allowed_change(tmp_path, heights):
    folder = run(tmp_path / "run", *arguments(heights), stop_after=5)
    moved = heights.rename(tmp_path / "moved.npy")
    assert "can't be read" not in status_of(folder).left_remark
    again, told = load_scene(SCENE[0], [*SCENE[1:], *arguments(moved), "drive.dwell=1 s"]), []
    with pytest.raises(SceneError, match=r"--allow drive\.dwell"):
        run_scene(again, MPI.COMM_SELF, folder, told.append)
    record = run_scene(again, MPI.COMM_SELF, folder, told.append, Options(allow=("drive.dwell",)))
    assert "changed from here on, as allowed: drive.dwell" in told and record["steps"] == 12
    np.save(moved, np.zeros((24, 24)))
    with pytest.raises(SceneError, match=r"punch\.file = '.* with other contents'"):
        run_scene(again, MPI.COMM_SELF, folder, told.append, Options(allow=("drive",)))
