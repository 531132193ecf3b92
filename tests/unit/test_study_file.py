"""Files of studies: what they mean as cases, and what is refused, all at once and before anything starts."""

import math
from pathlib import Path

import pytest

from pgfmd.scene import load_scene
from pgfmd.studies.cases import cases_of
from pgfmd.studies.study_file import StudyError, read_study
from pgfmd.studies.values import override_of, slug
from pgfmd.units import handy

EXAMPLE = """
title = "Preloads and speeds"
scene = "tri-tack"
[set]
"grid.n" = 64
[axes]
"drive.preload" = ["40 mN", "60 mN", "80 mN"]
drive.speed = ["1 um/s", "25 um/s"]
[axes.rheology]
"model 1" = { "rheology.modulus_ratio" = 250, rheology.relaxation_time = "400 us" }
elastic = { "rheology.model" = "elastic" }
[[case]]
name = "twin"
set = { "drive.preload" = "50 mN", output.snapshots = ["1 s", "0.5 t_pl"] }
[run]
ranks = 3
jobs = 2
checkpoint_every = "5min"
"""


def study(tmp_path, text):
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    return read_study(path)


def refused(tmp_path, text):
    with pytest.raises(StudyError) as caught:
        cases_of(study(tmp_path, text))
    return caught.value.problems


def test_a_grid_and_a_case_beside_it(tmp_path):
    read = study(tmp_path, EXAMPLE)
    assert (read.name, read.title, read.ranks, read.jobs, read.checkpoint_every) == (
        "study", "Preloads and speeds", 3, 2, "5min",
    )  # fmt: skip
    cases = cases_of(read)
    assert len(cases) == 3 * 2 * 2 + 1
    names = [case.name for case in cases]
    assert names[0] == "preload-40mN_speed-1um-s_model-1" and names[1] == "preload-40mN_speed-1um-s_elastic"
    assert names[-2:] == ["preload-80mN_speed-25um-s_elastic", "twin"]
    last = cases[-2]
    assert last.places == {"drive.preload": "80 mN", "drive.speed": "25 um/s", "rheology": "elastic"}
    assert (last.scene.drive.preload, last.scene.drive.speed, last.scene.grid.n) == (0.08, 25e-6, 64)
    assert last.scene.rheology.model == "elastic" and cases[0].scene.rheology.modulus_ratio == 250
    assert cases[-1].scene.output.snapshots == ("1.0 s", "0.5 t_pl") and cases[-1].places == {}


def test_what_a_run_is_given_makes_the_same_scene(tmp_path):
    for case in cases_of(study(tmp_path, EXAMPLE)):
        assert load_scene(case.source, case.overrides) == case.scene


def test_names_do_not_change_when_an_axis_grows(tmp_path):
    before = {case.name for case in cases_of(study(tmp_path, EXAMPLE))}
    longer = EXAMPLE.replace('"80 mN"]', '"80 mN", "100 mN"]')
    assert before < {case.name for case in cases_of(study(tmp_path, longer))}


def test_files_are_found_beside_the_study(tmp_path):
    (tmp_path / "mine.toml").write_text(EXAMPLE_SCENE, encoding="utf-8")
    (tmp_path / "own.txt").write_text("1e3 1e-9\n1e6 1e-12\n")
    text = 'scene = "mine.toml"\n[axes]\ndrive.speed = ["1 um/s"]\n'
    text += '[[case]]\nname = "own"\nset = { substrate.compliance_file = "own.txt" }'
    cases = cases_of(study(tmp_path, text))
    assert cases[0].source == str(tmp_path / "mine.toml")
    assert cases[1].scene.substrate.compliance_file == str(tmp_path / "own.txt")


EXAMPLE_SCENE = """
[punch]
pattern = "flat"
radius = "375 um"
[substrate]
youngs_modulus = "2 MPa"
poisson_ratio = 0.495
[rheology]
model = "elastic"
[adhesion]
work_of_adhesion = "50 mJ/m^2"
[drive]
speed = "10 um/s"
preload = "5 mN"
[grid]
n = 64
length = "1.5 mm"
"""


def test_every_problem_of_the_file_at_once(tmp_path):
    problems = refused(tmp_path, """
scene = "tri-tak"
axis = 1
[set]
grid.m = 64
output.directory = "x"
[axes]
drive.sped = ["1 um/s"]
speed = ["1 um/s"]
drive.preload = []
drive.dwell = "1 s"
[run]
ranks = 0
job = 2
[[case]]
set = { grid.n = 32 }
[[case]]
name = "a"
grid.n = 3
""")  # fmt: skip
    text = "\n".join(problems)
    for said in (
        "axis = 1: expected one of title, scene, set, axes, case, run; did you mean axes?",
        "scene = 'tri-tak'", "did you mean tri-tack?", "set: grid.m = 64", "did you mean grid.n?",
        "a study chooses its folders itself", "did you mean drive.speed?", "axes: speed", "expected at least one value",
        "one value needs no axis: it goes into [set]", "run: ranks = 0: expected a whole number above 0",
        "did you mean jobs?", "case 1: name", "case a: grid",
    ):  # fmt: skip
        assert said in text, said


def test_problems_of_the_file_hide_neither_names_nor_scenes(tmp_path):
    problems = refused(tmp_path, """
scene = "tri-tack"
[axes]
drive.preload = ["1 mN", "2 mm", "1 mN"]
[run]
ranks = "two"
[[case]]
name = "../x"
set = { drive.preload = "2 mN" }
[[case]]
name = "a b"
set = { drive.preload = "3 mN", grid.n = 2 }
[[case]]
name = "table.csv"
[[case]]
name = "wrong"
set = { grid.m = 3, grid.n = 1 }
""")  # fmt: skip
    told = (
        "axes: drive.preload: 1 mN is there twice", "run: ranks = 'two'", "case wrong: grid.m = 3",
        "case preload-2mm: drive.preload = '2 mm'", "case a b: grid.n = 2",
        "case = '../x'", "case = 'a b'", "case = 'table.csv'",
    )  # fmt: skip
    assert len(problems) == len(told)
    for said in told:
        assert any(said in problem for problem in problems), said


def test_names_are_told_beside_a_wrong_scene(tmp_path):
    problems = refused(tmp_path, 'scene = "tri-tak"\n[[case]]\nname = "a b"\n[[case]]\nname = "c"\n')
    assert len(problems) == 2 and "did you mean tri-tack?" in problems[0] and "case = 'a b'" in problems[1]


def test_problems_of_scenes_name_their_cases(tmp_path):
    problems = refused(tmp_path, """
scene = "tri-tack"
[axes]
drive.preload = ["1 mN", "2 mm"]
drive.speed = ["1 um/s", "2 um/s", "3 um/s", "4 um/s"]
[[case]]
name = "coarse"
set = { grid.n = 2 }
""")  # fmt: skip
    assert len(problems) == 2
    first = ", ".join(f"preload-2mm_speed-{speed}um-s" for speed in (1, 2, 3))
    assert problems[0].startswith(f"cases {first} and 1 more: ")
    assert "'2 mm'" in problems[0] and problems[1].startswith("case coarse: grid.n = 2")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[axes]\ndrive.speed = ["1 um/s", "1e-6 m/s"]', "speed-1um-s, speed-1e-6m-s: these cases are the same scene"),
        ('[axes]\ndrive.speed = ["1 um/s", "1 um/s"]', "1 um/s is there twice"),
        ('[axes]\ndrive.speed = ["1 um/s", "1um/s"]', "2 cases are called speed-1um-s"),
        ('[[case]]\nname = "a/b"', "a name of a folder"),
        ('[[case]]\nname = "a.log"', "a name of a folder"),
        ('[[case]]\nname = "a"\n[[case]]\nname = "a"', "two cases of this name"),
        ('[axes]\ndrive.speed = ["1 um/s"]\n[axes.b]\nx = { drive.speed = "2 um/s" }', "set by drive.speed and by b"),
        ('[set]\ndrive.speed = "1 um/s"\n[axes]\ndrive.speed = ["1 um/s"]', "is in [set], too"),
        ("", "nothing varies"),
    ],
)  # fmt: skip
def test_refused(tmp_path, text, said):
    assert said in "\n".join(refused(tmp_path, f'scene = "tri-tack"\n{text}'))


def test_a_bundle_may_change_what_is_set_for_all(tmp_path):
    text = 'scene = "tri-tack"\nset.solver.accuracy = 1e-3\naxes.solver.fine = { solver.accuracy = 1e-4 }\n'
    text += "axes.solver.as_set = {}"
    assert [case.scene.solver.accuracy for case in cases_of(study(tmp_path, text))] == [1e-4, 1e-3]


def test_files_that_are_not_there_or_no_toml(tmp_path):
    with pytest.raises(StudyError, match="no such file"):
        read_study(tmp_path / "none.toml")
    with pytest.raises(StudyError, match="not valid TOML"):
        study(tmp_path, "scene = tri-tack")


@pytest.mark.parametrize(
    "value", ["1 um/s", "0.5", " 1 s", "true", "inf", 3, 1e-6, True, ["1 s", "0.5 t_pl"], "it's", 'a"b']
)
def test_overrides_keep_their_value(value):
    from pgfmd.scene.unresolved_scene import override_value

    key, _, text = override_of("drive.speed", value).partition("=")
    assert key == "drive.speed" and override_value(text.strip()) == value


def test_names_from_values():
    texts = ("1 um/s", "50 mJ/m^2", "2.5 µm", "-1 um", "model 1", "Größe", "[1, 2]", "1e-3")
    assert [slug(text) for text in texts] == [
        "1um-s", "50mJ-m2", "2.5um", "minus1um", "model-1", "Gro-e", "1-2", "1e-3",
    ]  # fmt: skip


def test_the_sign_of_a_value_is_in_the_name(tmp_path):
    cases = cases_of(study(tmp_path, 'scene = "tri-tack"\n[axes]\ndrive.clearance = ["-1 um", "1 um"]'))
    assert [case.name for case in cases] == ["clearance-minus1um", "clearance-1um"]


def test_handy_units():
    assert handy([1e-6, 2.5e-5], "m/s") == (1e-6, "µm/s")
    assert handy([0.05], "J/m^2") == (1e-3, "mJ/m²")
    assert handy([0.0], "m") == (1.0, "m") and handy([5.0], "") == (1.0, "")
    factor, unit = handy([999.9999999999 * 1e-9 + 1e-19], "m")
    assert math.isclose(factor, 1e-6) and unit == "µm"


def test_the_example_of_the_docs(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "how-to" / "studies.md").read_text(encoding="utf-8")
    cases = cases_of(study(tmp_path, text.partition("```toml\n")[2].partition("```")[0]))
    assert len(cases) == 13 and "`preload-40mN_speed-1um-s_model-1`" in text
    assert cases[0].name == "preload-40mN_speed-1um-s_model-1" and cases[-1].name == "slow"
