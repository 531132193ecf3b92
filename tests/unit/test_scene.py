"""Scenes: what is read, resolved and written again, and every refusal with its key and its cure."""

import importlib.util
import math
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from pgfmd.errors import SceneError
from pgfmd.scene import load_scene, parse_scene, scene_from_mapping, shipped_scenes, shipped_text
from pgfmd.scene.fields import snapshot_time
from pgfmd.scene.model import PATTERNS, RHEOLOGIES, SECTIONS, Output, Solver
from pgfmd.scene.partial_scene import MISSING
from pgfmd.scene.solver_section import PRECISIONS

PUNCH_VALUES = {
    "radius": "300 um",
    "wavelength": "150 um",
    "amplitude": "4 um",
    "curvature_radius": "20 mm",
    "exponent": 3,
    "layer_step": "0.2 um",
    "height_jitter": "10 nm",
    "seed": 7,
    "file": "heights.npy",
    "file_size": ["1 mm", "1 mm"],
    "file_relief": "0.2 um",
    "hurst": 0.8,
    "rms_height": "1 um",
    "rms_slope": 0.1,
    "longest": "400 um",
    "roll_off": "200 um",
    "shortest": "100 um",
    "period": "1.5 mm",
    "file_unit": "um",
    "file_peaks": "up",
    "file_detrend": "tilt",
    "file_missing": "fill",
    "file_missing_value": [0, -9999],
}
EITHER = {"rough": {"rms_height", "rms_slope"}}
"""Keys of a pattern that say the same: one of them is needed, and only one may be there."""
RHEOLOGY_VALUES = {
    "modulus_ratio": 250,
    "relaxation_time": "40 us",
    "elements": 5,
    "time_ratio": 6,
    "exponent": 0.8,
    "kappa": [10, 20.5],
    "tau": ["1 ms", "10 us"],
}
GEOMETRIC = {"model": "geometric"} | {name: RHEOLOGY_VALUES[name] for name in RHEOLOGIES["geometric"][0]}


def mapping(**sections):
    """A sound scene as nested dicts; a section given replaces keys, None deletes one."""
    scene = {
        "punch": {"pattern": "flat", "radius": "300 um"},
        "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
        "rheology": {"model": "elastic"},
        "adhesion": {"work_of_adhesion": "50 mJ/m^2"},
        "drive": {"speed": "1 um/s", "preload": "5 mN"},
        "grid": {"n": 64, "length": "1.5 mm"},
    }
    for name, keys in sections.items():
        merged = scene.get(name, {}) | keys
        scene[name] = {key: value for key, value in merged.items() if value is not None}
    return scene


def punch(pattern, *names, **others):
    """A [punch] of this pattern with the keys of these names."""
    return {"radius": None, "pattern": pattern} | {name: PUNCH_VALUES[name] for name in names} | others


def problems(scene, *overrides, **where):
    """The problems of a scene that must not load, by key; one list per key."""
    with pytest.raises(SceneError) as error:
        scene_from_mapping(scene, overrides, **where)
    found = {}
    for problem in error.value.problems:
        found.setdefault(problem.key, []).append(problem)
    return found


def only_problem(scene, *overrides, **where):
    ((key, found),) = problems(scene, *overrides, **where).items()
    (problem,) = found
    return key, problem


# Shipped scenes -----------------------------------------------------------------------------------------------------


def test_shipped_scenes_are_the_seven():
    assert shipped_scenes() == [
        "cyclic-hold", "flat-punch", "hertz", "hex-tack", "rough-film", "sphere-tack", "tri-tack",
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["flat-punch", "hertz", "hex-tack", "tri-tack"])
def test_a_shipped_scene_loads_from_its_name_and_from_a_copy_of_its_text(name, tmp_path):
    copy = tmp_path / "mine.toml"
    copy.write_text(shipped_text(name), encoding="utf-8")
    assert load_scene(name) == load_scene(copy) == load_scene(str(copy))
    assert shipped_text(name).startswith("#")


def test_tri_tack_has_the_numbers_of_the_paper():
    scene = load_scene("tri-tack")
    assert (scene.punch.pattern, scene.punch.radius, scene.grid.length) == ("triangular", 375e-6, 1.5e-3)
    assert (scene.punch.wavelength, scene.punch.amplitude) == (150e-6, 4e-6)
    assert (scene.substrate.youngs_modulus, scene.substrate.poisson_ratio) == (2e6, 0.495)
    assert (scene.substrate.thickness, scene.substrate.base, scene.substrate.boundary) == (math.inf, None, "periodic")
    rheology = scene.rheology
    assert (rheology.model, rheology.modulus_ratio, rheology.relaxation_time) == ("single", 250, 400e-6)
    assert (scene.adhesion.work_of_adhesion, scene.drive.speed, scene.drive.preload) == (50e-3, 1e-6, 40e-3)
    assert scene.output.snapshot_times == [(1.0, True), (1.125, True)]


def test_hex_tack_has_the_numbers_of_the_paper():
    scene = load_scene("hex-tack")
    assert (scene.punch.pattern, scene.punch.amplitude, scene.drive.preload) == ("hexagonal", 9.2e-6, 10e-3)
    assert scene.rheology.relaxation_time == 200e-6


@pytest.mark.parametrize(("n", "micrometres"), [(2048, 0.264), (4096, 0.187)])
def test_the_automatic_range_is_the_papers(n, micrometres):
    scene = load_scene("tri-tack", [f"grid.n={n}"])
    assert scene.adhesion.range * 1e6 == pytest.approx(micrometres, abs=5e-4)
    assert scene.adhesion.q_ref == pytest.approx(2 * math.pi * n / 1.5e-3, rel=1e-15)


def test_hertz_stays_inside_its_punch_at_small_strain():
    scene = load_scene("hertz")
    tip = scene.punch.curvature_radius
    contact = (3 * scene.drive.preload * tip / (4 * scene.substrate.contact_modulus)) ** (1 / 3)
    assert contact / scene.punch.radius == pytest.approx(0.6, abs=0.01)
    assert contact / tip < 0.03
    stiffness = math.pi**2 * scene.adhesion.work_of_adhesion / (2 * scene.adhesion.range**2)
    peak_pressure = 1.5 * scene.drive.preload / (math.pi * contact**2)
    assert peak_pressure / stiffness < 0.005 * contact**2 / tip


def test_an_unknown_shipped_name_suggests_the_nearest():
    with pytest.raises(SceneError, match="did you mean hertz"):
        shipped_text("herz")
    with pytest.raises(SceneError, match="did you mean tri-tack"):
        load_scene("tri_tack")


# Resolving ----------------------------------------------------------------------------------------------------------


def test_automatic_values_are_resolved_and_given_ones_are_kept():
    scene = scene_from_mapping(mapping(drive={"speed": "2 um/s"}, adhesion={"range": "0.5 um"}))
    assert scene.adhesion.range == scene.drive.clearance == 0.5e-6
    assert scene.drive.retract_speed == scene.drive.speed == 2e-6
    # the turn overshoots by v T/4, a fiftieth of the range
    assert scene.drive.speed * scene.drive.turn_time / 4 == pytest.approx(0.02 * 0.5e-6, rel=1e-14)
    given = {"retract_speed": "3 um/s", "turn_time": "2 ms", "clearance": "-1 um", "dwell": "1 s"}
    drive = scene_from_mapping(mapping(drive=given)).drive
    assert (drive.retract_speed, drive.turn_time, drive.clearance, drive.dwell) == (3e-6, 2e-3, -1e-6, 1.0)


def test_automatic_range_balances_the_laws_stiffness():
    given = {"range_factor": 0.3, "q_ref": "5e6 1/m"}
    scene = scene_from_mapping(mapping(adhesion=given))
    stiffness = math.pi**2 * 0.05 / (2 * scene.adhesion.range**2)
    assert scene.substrate.contact_modulus == pytest.approx(2e6 / (1 - 0.495**2), rel=1e-15)
    assert stiffness == pytest.approx(0.3 * 5e6 * scene.substrate.contact_modulus, rel=1e-13)


def test_defaults_are_those_of_the_reference():
    scene = scene_from_mapping(mapping())
    assert scene.punch.curvature_radius == math.inf
    assert (scene.punch.layer_step, scene.punch.height_jitter, scene.punch.wavelength) == (0, 0, None)
    assert (scene.substrate.boundary, scene.substrate.prestrain) == ("periodic", (1.0, 1.0))
    assert (scene.adhesion.law, scene.adhesion.range_factor, scene.drive.dwell) == ("cosine", 0.156, 0)
    solver, output = scene.solver, scene.output
    assert (solver.scheme, solver.accuracy, solver.max_steps) == ("inertialess", 0.01, 10**6)
    assert (output.directory, output.snapshots, output.every, output.surface) == (None, (), 1, False)
    assert output.energy is True and scene.title == ""


def test_a_film_is_bonded_unless_it_slides():
    assert scene_from_mapping(mapping(substrate={"thickness": "2 mm"})).substrate.base == "bonded"
    sliding = mapping(substrate={"thickness": "2 mm", "base": "sliding", "boundary": "free"})
    assert scene_from_mapping(sliding).substrate.base == "sliding"


def test_paths_start_at_the_scenes_folder_and_become_absolute(tmp_path, monkeypatch):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "z.npy").touch()
    (tmp_path / "green.txt").touch()
    text = scene_from_mapping(mapping()).to_toml()
    text = text.replace('"flat"', '"file"\nfile = "maps/z.npy"\nfile_size = ["1 mm", "2 mm"]\nfile_relief = "80 nm"')
    text = text.replace("[substrate]", '[substrate]\ncompliance_file = "green.txt"')
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path / "maps")
    scene = load_scene("../scene.toml")
    assert Path(scene.punch.file).is_absolute() and Path(scene.punch.file).samefile(tmp_path / "maps" / "z.npy")
    assert Path(scene.substrate.compliance_file).samefile(tmp_path / "green.txt")
    assert (scene.punch.file_size, scene.punch.file_relief) == ((1e-3, 2e-3), 80e-9)
    assert parse_scene(scene.to_toml(), folder="/") == scene


def test_a_scene_without_overrides_is_left_as_it_was():
    scene = mapping()
    scene_from_mapping(scene, ["grid.n=32"])
    assert scene == mapping()


# Writing ------------------------------------------------------------------------------------------------------------

VARIANTS = {
    "prony": mapping(rheology={"model": "prony", "kappa": [1, 2.5], "tau": ["1 ms", "3 us"]}),
    "geometric": mapping(rheology=GEOMETRIC),
    "film": mapping(substrate={"thickness": "2 mm", "base": "sliding", "poisson_ratio": 0.5}),
    "prestrained": mapping(substrate={"prestrain": [1, 1.3]}),
    "sinusoid": mapping(punch=punch("sinusoid", "wavelength", "amplitude")),
    "power": mapping(punch=punch("power", "radius", "curvature_radius", "exponent", "layer_step")),
    "jitter": mapping(punch=punch("hexagonal", "radius", "wavelength", "amplitude", "height_jitter", "seed")),
    "output": mapping(output={"directory": 'out/"a" \\ b µ', "snapshots": ["3 ms", "1.5 t_pl"], "surface": True}),
    "title": mapping() | {"title": 'A "quoted" title\nover two lines \x7f é 𝛒'},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_resolved_toml_loads_to_an_equal_scene(variant):
    scene = scene_from_mapping(VARIANTS[variant])
    again = parse_scene(scene.to_toml())
    assert again == scene
    assert again.model_dump() == scene.model_dump()
    assert again.to_toml() == scene.to_toml()


@pytest.mark.parametrize("name", ["flat-punch", "hertz", "hex-tack", "tri-tack"])
def test_shipped_scenes_survive_writing(name):
    scene = load_scene(name, ["grid.n=101", "drive.speed=0.3 um/s"])
    assert parse_scene(scene.to_toml()) == scene


def test_the_resolved_toml_holds_si_units_and_nothing_automatic():
    text = load_scene("tri-tack").to_toml()
    assert 'radius = "0.000375 m"' in text and 'work_of_adhesion = "0.05 J/m^2"' in text
    # Whether a face is symmetric is known when its heights are: this key says whether to make use of it.
    text = text.replace('symmetry = "auto"', "").replace('coarse_grid = "auto"', "")
    assert "auto" not in text and '"grid"' not in text


def test_scenes_that_differ_are_not_equal():
    assert load_scene("tri-tack") != load_scene("tri-tack", ["solver.accuracy=0.02"])


def test_a_scene_survives_pickling_and_can_not_be_changed():
    scene = load_scene("hex-tack")
    assert pickle.loads(pickle.dumps(scene)) == scene
    for change in (
        lambda: setattr(scene.grid, "n", 3),
        lambda: setattr(scene, "title", "x"),
        lambda: delattr(scene, "grid"),
    ):
        with pytest.raises(AttributeError, match="a scene can't be changed"):
            change()


# Overrides ----------------------------------------------------------------------------------------------------------


def test_overrides_are_read_as_toml_or_as_a_text():
    overrides = ["drive.speed=10 um/s", ' drive.preload = "3 mN" ', "grid.n=128", "output.energy=false"]
    overrides += ['output.snapshots=["1 s", "1 t_pl"]', "substrate.thickness=inf", "title=a = b", "grid.n=96"]
    scene = scene_from_mapping(mapping(), overrides)
    assert (scene.drive.speed, scene.drive.preload, scene.grid.n) == (1e-5, 3e-3, 96)
    assert scene.output.energy is False and scene.title == "a = b"
    assert scene.output.snapshot_times == [(1.0, False), (1.0, True)]


def test_a_new_pattern_or_model_drops_what_it_has_no_use_for():
    scene = load_scene("tri-tack", ["rheology.model=elastic", "punch.pattern=flat"])
    assert (scene.rheology.modulus_ratio, scene.punch.wavelength, scene.punch.radius) == (None, None, 375e-6)
    # but not what the same command line asks for
    with pytest.raises(SceneError, match=r"rheology\.modulus_ratio = 3"):
        load_scene("tri-tack", ["rheology.model=elastic", "rheology.modulus_ratio=3"])


@pytest.mark.parametrize("override", ["grid.n", "n=3", "=3", ".n=3", "grid.=3", ""])
def test_a_malformed_override_is_refused(override):
    key, problem = only_problem(mapping(), override)
    assert (key, problem.value, problem.expected) == ("override", override, "section.key=value")


def test_overrides_can_not_smuggle_in_other_keys():
    assert list(problems(mapping(), "grid.n=3\nlength = 2")) == ["grid.n"]
    assert list(problems(mapping(), "grid.n.m=3")) == ["grid.n.m"]
    assert list(problems(mapping(), "punch.pattern=[1]")) == ["punch.pattern"]


# Files that can't be read -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"[grid]\nn = 3 um\n", "line 2"),
        (b"\xff\x00\x81", "not a text file"),
        (b"[grid]\n[grid]\n", "valid TOML"),
        (None, "tri-tack"),
    ],
)
def test_an_unreadable_scene_is_refused(content, words, tmp_path):
    path = tmp_path / "scene.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=words) as error:
        load_scene(path)
    assert error.value.exit_code == 2


def test_a_folder_or_an_impossible_name_is_refused(tmp_path):
    for source in (tmp_path, "x" * 5000, "a\0b"):
        with pytest.raises(SceneError, match="1 problem"):
            load_scene(source)


# Single keys --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("drive.preload=", "the text is empty"),
        ("drive.preload=0 N", "above 0"),
        ("drive.preload=-3 mN", "above 0"),
        ("drive.preload=inf", "finite"),
        ("drive.preload=nan N", "finite"),
        ("drive.speed=1e400 m/s", "finite"),
        ("drive.speed=3", 'write "3 m/s"'),
        ("drive.speed=true", "a speed above 0"),
        ("drive.speed=1 mN", '"1 mN" is a force'),
        ("drive.retract_speed=0 m/s", "above 0"),
        ("drive.dwell=-1 s", "at least 0"),
        ("drive.turn_time=automatic", 'or "auto"'),
        ("drive.clearance=inf", "finite"),
        ("grid.n=0", "greater than or equal to 4"),
        ("grid.n=3", "greater than or equal to 4"),
        ("grid.n=65537", "less than or equal to 65536"),
        ("grid.n=64.0", "integer"),
        ('grid.n="64"', "integer"),
        ("grid.n=true", "integer"),
        ("grid.length=nan m", "finite"),
        ("punch.radius=-1 um", "above 0"),
        ("punch.curvature_radius=-3 mm", "above 0"),
        ("punch.curvature_radius=-inf", "above 0"),
        ("punch.layer_step=-1 nm", "at least 0"),
        ("substrate.poisson_ratio=0.51", "at most 0.5"),
        ("substrate.poisson_ratio=-1", "above -1"),
        ("substrate.poisson_ratio=nan", "finite"),
        ('substrate.poisson_ratio="0.3"', "without quotes"),
        ("substrate.thickness=-inf", "above 0"),
        ("substrate.thickness=0 m", "above 0"),
        ("substrate.prestrain=[1, 0]", "above 0"),
        ("substrate.prestrain=[1]", "a list of 2"),
        ("substrate.prestrain=1.5", "square brackets"),
        ("substrate.youngs_modulus=2", 'write "2 Pa"'),
        ("adhesion.work_of_adhesion=0 J/m^2", "above 0"),
        ("adhesion.range=0 um", "above 0"),
        ("adhesion.range=-1 um", "above 0"),
        ("adhesion.q_ref=cell", 'or "grid"'),
        ("adhesion.range_factor=0", "above 0"),
        ("adhesion.law=cosin", "did you mean cosine?"),
        ("solver.accuracy=0.5", "at most 0.3"),
        ("solver.accuracy=1e-9", "at least 1e-08"),
        ("solver.max_steps=0", "greater than or equal to 1"),
        ("output.every=0", "greater than or equal to 1"),
        ("output.surface=1", "boolean"),
        ('output.directory=""', "at least 1 character"),
        ("output.snapshots=3 s", "square brackets"),
    ],
)
def test_a_wrong_value_is_refused_by_its_key(override, words):
    key, problem = only_problem(mapping(), override)
    assert key == override.split("=")[0]
    assert words in f"{problem.expected}; {problem.cure}"


def test_only_quasistatic_runs_have_a_modulus_of_their_own():
    key, problem = only_problem(mapping(), "solver.modulus=instantaneous")
    assert key == "solver.modulus" and "quasistatic" in problem.expected
    scene_from_mapping(mapping(), ["solver.modulus=instantaneous", "solver.scheme=quasistatic"])


@pytest.mark.parametrize("scheme", ["inertialess", "gfmd", "quasistatic"])
@pytest.mark.parametrize("machine", ["drive.control=load", "drive.machine_stiffness=38.1 kN/m"])
def test_machines_give_way_in_every_scheme(scheme, machine):
    rheology = ["rheology.model=single", "rheology.modulus_ratio=20", "rheology.relaxation_time=1 s"]
    scene_from_mapping(mapping(), [machine, f"solver.scheme={scheme}", *rheology])


@pytest.mark.parametrize(
    ("spring", "precision"),
    [("drive.control=load", "single"), ("drive.control=load", "mixed"), ("drive.machine_stiffness=1 kN/m", "single")],
)
def test_springs_are_too_long_for_coarse_numbers(spring, precision):
    key, problem = only_problem(mapping(), "solver.scheme=quasistatic", spring, f"solver.precision={precision}")
    assert key == "solver.precision" and "double" in problem.expected


def test_a_load_is_controlled_by_no_spring_but_its_own():
    overrides = ("solver.scheme=quasistatic", "drive.control=load", "drive.machine_stiffness=38.1 kN/m")
    key, problem = only_problem(mapping(), *overrides)
    assert key == "drive.machine_stiffness" and "load control" in problem.expected


ONE_ELEMENT = ["rheology.model=single", "rheology.relaxation_time=1 s"]


@pytest.mark.parametrize(
    ("overrides", "key"),
    [
        (["solver.accuracy=5e-4"], "solver.accuracy"),
        ([*ONE_ELEMENT, "rheology.modulus_ratio=1e5"], "rheology.modulus_ratio"),
        (["rheology.model=prony", "rheology.kappa=[1e5]", 'rheology.tau=["1 s"]'], "rheology.kappa"),
        ([*ONE_ELEMENT, "rheology.modulus_ratio=10", "solver.scheme=gfmd"], "solver.precision"),
    ],
)
def test_single_precision_is_refused_where_it_does_not_suffice(overrides, key):
    found, problem = only_problem(mapping(), "solver.precision=single", *overrides)
    assert found == key
    assert "mixed" in problem.cure or key == "solver.precision"


def test_a_table_within_a_table_is_a_section():
    text = shipped_text("tri-tack") + '\n[solver]\nscheme = "gfmd"\n[solver.gfmd]\nomega_tau = 12.5\n'
    scene = parse_scene(text, ["solver.gfmd.steps_per_tau=40"])
    assert (scene.solver_gfmd.omega_tau, scene.solver_gfmd.steps_per_tau) == (12.5, 40.0)
    assert parse_scene(scene.to_toml()) == scene
    # Kept by a scene that is run by another scheme for a change, but not written where it has no use.
    assert "gfmd" not in parse_scene(text, ["solver.scheme=inertialess"]).to_toml()


def test_tables_and_models_name_the_same_choices():
    def choices(model, name):
        return list(model.model_fields[name].annotation.__args__)

    assert choices(Solver, "precision") == list(PRECISIONS)
    assert choices(SECTIONS["punch"], "pattern") == list(PATTERNS)
    assert choices(SECTIONS["rheology"], "model") == list(RHEOLOGIES)


def test_every_wrong_entry_of_a_list_is_reported():
    wrong = mapping(rheology={"model": "prony", "kappa": [1, -1, "2"], "tau": ["1 s", 3, "4 m"]})
    found = problems(wrong)
    assert [problem.value for problem in found["rheology.kappa"]] == [-1, "2"]
    assert [problem.value for problem in found["rheology.tau"]] == [3, "4 m"]
    assert "entry 2 of the list" in found["rheology.tau"][0].expected
    wrong = ["3", "4 m", "-1 s", 7, "inf s", "every 0 s", "every 3 Pa", "every"]
    found = problems(mapping(output={"snapshots": ["1 t_pl", "every 2 s", *wrong]}))
    assert [problem.value for problem in found["output.snapshots"]] == wrong


def test_snapshots_are_times_or_fractions_of_the_time_to_the_preload():
    assert Output.model_validate({"snapshots": ["3 ms", " 1.125t_pl", ".5 t_pl"]}).snapshots == (
        "0.003 s",
        "1.125 t_pl",
        "0.5 t_pl",
    )
    assert snapshot_time("2 min") == (120.0, False)
    often = Output.model_validate({"snapshots": ["3 s", "every 2ms", "1 t_pl", "every 1 min"]})
    assert often.snapshots == ("3.0 s", "every 0.002 s", "1.0 t_pl", "every 60.0 s")
    assert [rhythm.size for rhythm in often.rhythms] == [0.002, 60.0]
    assert often.snapshot_times == [(3.0, False), (1.0, True)]


# Unknown keys -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "cure"),
    [
        ("drive.sped=1 um/s", "did you mean speed?"),
        ("substrate.young_modulus=1 MPa", "did you mean youngs_modulus?"),
        ("punch.preload=1 mN", "move it to [drive]"),
        ("drvie.speed=1 um/s", "did you mean drive?"),
        ("grid.colour=red", ""),
    ],
)
def test_an_unknown_key_is_refused_with_a_suggestion(override, cure):
    key, problem = only_problem(mapping(), override)
    assert key.split(".")[0] == override.split(".")[0]
    assert problem.cure == cure


def test_a_key_above_all_sections_is_sent_to_its_section():
    key, problem = only_problem(mapping() | {"preload": "3 mN"})
    assert (key, problem.cure) == ("preload", "move it to [drive]")


def test_a_section_must_be_a_section():
    found = problems(mapping() | {"grid": 3, "title": 4})
    assert found.keys() >= {"grid", "title", "grid.n", "grid.length"}


def test_missing_keys_and_sections_are_reported_key_by_key():
    found = problems({})
    fields = {f"{name}.{key}": field for name, model in SECTIONS.items() for key, field in model.model_fields.items()}
    required = {key for key, field in fields.items() if field.is_required()}
    # That of the law, and those of the programme, that a scene has without a word.
    assert found.keys() == required | {"adhesion.work_of_adhesion", "drive.speed", "drive.preload"}
    assert all(problem.value is MISSING for (problem,) in found.values())
    assert found["drive.preload"][0].cure == 'add preload = "40 mN" to [drive]'


def test_the_relief_of_a_map_is_a_length_above_zero(tmp_path):
    (tmp_path / "heights.npy").touch()
    for value in ("0 nm", "-1 um", "1 mN"):
        key, problem = only_problem(mapping(punch=punch("file", "file", file_relief=value)), folder=tmp_path)
        assert key == "punch.file_relief" and "a length above 0" in problem.expected


# Several keys -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_has_its_keys_demands_the_required_and_refuses_the_rest(pattern, tmp_path):
    (tmp_path / "heights.npy").touch()
    required, optional = PATTERNS[pattern]
    either = EITHER.get(pattern, set())
    required, optional = required | set(sorted(either)[:1]), optional - either
    everything = mapping(punch=punch(pattern, *required, *optional))
    assert scene_from_mapping(everything, folder=tmp_path).punch.pattern == pattern
    bare = mapping(punch=punch(pattern, *required))
    assert scene_from_mapping(bare, folder=tmp_path).punch.layer_step == 0
    for name in required:
        lacking = mapping(punch=punch(pattern, *(required - {name})))
        assert problems(lacking, folder=tmp_path)[f"punch.{name}"][0].value is MISSING
    for name in PUNCH_VALUES.keys() - required - optional - either:
        key, problem = only_problem(mapping(punch=punch(pattern, *required, name)), folder=tmp_path)
        assert (key, problem.value) == (f"punch.{name}", PUNCH_VALUES[name])
        assert "delete it" in problem.cure and pattern in problem.expected


@pytest.mark.parametrize("model", RHEOLOGIES)
def test_a_rheology_has_its_keys_demands_the_required_and_refuses_the_rest(model):
    required, _ = RHEOLOGIES[model]
    sound = {"model": model} | {name: RHEOLOGY_VALUES[name] for name in required}
    assert scene_from_mapping(mapping(rheology=sound)).rheology.model == model
    for name in required:
        assert only_problem(mapping(rheology=sound | {name: None}))[0] == f"rheology.{name}"
    for name in RHEOLOGY_VALUES.keys() - required:
        key, problem = only_problem(mapping(rheology=sound | {name: RHEOLOGY_VALUES[name]}))
        assert key == f"rheology.{name}" and "delete it" in problem.cure


def test_a_key_without_use_is_refused_even_at_its_default():
    key, _ = only_problem(mapping(punch={"height_jitter": "0 um"}))
    assert key == "punch.height_jitter"


TRIANGULAR = punch("triangular", "radius", "wavelength", "amplitude")
SINUSOID = punch("sinusoid", "wavelength", "amplitude")
FREE = {"boundary": "free"}
SINGLE = {"model": "single", "relaxation_time": "1 s"}


@pytest.mark.parametrize(
    ("sections", "key", "cure"),
    [
        ({"punch": {"radius": "751 um"}}, "punch.radius", "raise grid.length to 0.001502"),
        ({"punch": {"radius": "376 um"}, "substrate": FREE}, "punch.radius", "raise grid.length to 0.001504"),
        ({"punch": {"radius": "751 um"}, "substrate": FREE}, "punch.radius", "raise grid.length"),
        ({"punch": SINUSOID, "substrate": FREE}, "punch.radius", 'substrate.boundary = "periodic"'),
        ({"punch": {"radius": "20 um"}}, "grid.n", "raise grid.n to 75"),
        ({"punch": TRIANGULAR | {"wavelength": "46 um"}}, "punch.wavelength", "raise grid.n to 66"),
        ({"punch": SINUSOID | {"wavelength": "170 um"}}, "punch.wavelength", "give punch.radius"),
        ({"punch": SINUSOID | {"wavelength": "4 mm"}}, "punch.wavelength", "give punch.radius"),
        ({"punch": SINUSOID | {"curvature_radius": "1 m"}}, "punch.curvature_radius", "give punch.radius"),
        ({"punch": punch("file", file="none.npy", radius="300 um")}, "punch.file", "none.npy"),
        ({"punch": punch("file", file="", radius="300 um")}, "punch.file", ""),
        ({"substrate": {"compliance_file": "none.txt"}}, "substrate.compliance_file", "none.txt"),
        ({"substrate": {"base": "bonded"}}, "substrate.base", "give a thickness"),
        ({"substrate": {"base": "bonded", "thickness": "inf"}}, "substrate.base", "give a thickness"),
        ({"substrate": {"prestrain": [1, 2], "thickness": "2 mm"}}, "substrate.prestrain", "delete it"),
        ({"substrate": {"prestrain": [1, 2], "boundary": "free"}}, "substrate.prestrain", "delete it"),
        ({"rheology": {"model": "prony", "kappa": [1, 2], "tau": ["1 s"]}}, "rheology.tau", "it has 1"),
        ({"rheology": {"model": "prony", "kappa": [6e5, 5e5], "tau": ["1 s", "2 s"]}}, "rheology.kappa", "reduce"),
        ({"rheology": {"model": "prony", "kappa": [], "tau": ["1 s"]}}, "rheology.kappa", "it has 0"),
        ({"rheology": SINGLE | {"modulus_ratio": 1}}, "rheology.modulus_ratio", ""),
        ({"rheology": SINGLE | {"modulus_ratio": 2e6}}, "rheology.modulus_ratio", ""),
        ({"rheology": GEOMETRIC | {"elements": 200, "time_ratio": 1e3}}, "rheology.elements", "fewer"),
        ({"rheology": GEOMETRIC | {"elements": 0}}, "rheology.elements", ""),
        ({"rheology": GEOMETRIC | {"time_ratio": 1}}, "rheology.time_ratio", ""),
    ],
)
def test_keys_that_do_not_go_together_are_refused_with_a_cure(sections, key, cure):
    found_key, problem = only_problem(mapping(**sections))
    assert found_key == key
    assert cure in problem.cure


def test_a_compliance_file_stands_alone(tmp_path):
    (tmp_path / "g.txt").touch()
    own = {"compliance_file": "g.txt"}
    scene = scene_from_mapping(mapping(substrate=own), folder=tmp_path)
    assert scene.substrate.compliance_file == str(tmp_path / "g.txt")
    for key, value in {"thickness": "2 mm", "prestrain": [1, 2], "boundary": "free"}.items():
        assert only_problem(mapping(substrate=own | {key: value}), folder=tmp_path)[0] == f"substrate.{key}"


@pytest.mark.parametrize(
    "sections",
    [
        {"punch": {"radius": "750 um"}},
        {"punch": {"radius": "375 um"}, "substrate": {"boundary": "free"}},
        {"punch": TRIANGULAR | {"wavelength": "46.875 um"}},
        {"punch": SINUSOID | {"wavelength": "300 um"}},
        {"punch": SINUSOID | {"wavelength": "170 um", "radius": "300 um"}},
        {"substrate": {"thickness": "2 mm", "poisson_ratio": 0.5}},
        {"substrate": {"prestrain": [1, 1], "boundary": "free"}},
    ],
)
def test_limits_themselves_are_allowed(sections):
    scene_from_mapping(mapping(**sections))


def test_all_problems_come_out_together_even_where_others_hide_them():
    wrong = mapping(
        punch=TRIANGULAR | {"radius": "1 mm", "exponent": 3},
        substrate={"youngs_modulus": 2, "base": "sliding"},
        rheology={"model": "prony", "kappa": [1, 2], "tau": ["1 s"], "tua": 3},
        adhesion={"work_of_adhesion": "50 mJ"},
        drive={"preload": "", "speed": "nan m/s"},
        solver={"scheme": "static"},
    )
    assert problems(wrong, "grid.n=nought", "oops").keys() == {
        "override",
        "punch.radius",
        "punch.exponent",
        "substrate.youngs_modulus",
        "substrate.base",
        "rheology.tau",
        "rheology.tua",
        "adhesion.work_of_adhesion",
        "drive.preload",
        "drive.speed",
        "grid.n",
        "solver.scheme",
    }


def test_the_message_names_source_key_value_expectation_and_cure():
    with pytest.raises(SceneError) as error:
        load_scene("tri-tack", ["drive.preload=3", "grid.n=0"])
    text = str(error.value)
    assert text.startswith("tri-tack: 2 problems")
    assert 'drive.preload = 3: expected a force above 0, such as "40 mN"; ' in text and 'write "3 N"' in text


# Around -------------------------------------------------------------------------------------------------------------


def test_the_reference_page_has_every_key_with_a_meaning():
    path = Path(__file__).parents[2] / "docs" / "make_scene_reference.py"
    spec = importlib.util.spec_from_file_location("make_scene_reference", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = module.page()
    for name, model in SECTIONS.items():
        table = page.split(f"## [{name}]")[1].split("\n## ")[0]
        for key, field in model.model_fields.items():
            assert f"| `{key}` |" in table and field.description.replace("|", "\\|") in table
    assert "| `speed` | speed [m/s], above 0 | - | speed of the approach; required without steps |" in page
    assert '"quasistatic"' in page and "## [solver.gfmd]" in page


def test_reading_a_scene_imports_neither_mpi_nor_compilers_nor_plots():
    heavy = "('mpi4py', 'mpi4py_fft', 'numba', 'h5py', 'matplotlib', 'pint')"
    found = f"found = [name for name in {heavy} if name in sys.modules]"
    code = f"import sys, pgfmd.scene; {found}; assert not found, found"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
    code = f"import sys, pgfmd.scene; pgfmd.scene.load_scene('tri-tack'); {found}; assert not found, found"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
