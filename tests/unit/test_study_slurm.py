"""Studies as arrays of Slurm jobs, with a sbatch that only takes notes; a real Slurm runs jobs/slurm-array.sh in
tests/faults/test_jobs.py."""

import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest

from pgfmd import cli
from pgfmd.forecast.estimate import PROGRAM_BYTES, memory_of
from pgfmd.scene import load_scene, shipped_text
from pgfmd.studies.cases import cases_of
from pgfmd.studies.study_file import read_study

ROOT = Path(__file__).parents[2]
STUDY = """
scene = "tri-tack"
set.grid.n = 24
set.output.snapshots = ["1 s", "0.5 t_pl"]
axes.drive.speed = ["1 um/s", "2 um/s"]
run = { ranks = 3 }
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a blank in its name; sbatch and squeue write down how they were called."""
    work, programs = tmp_path / "my work", tmp_path / "bin"
    work.mkdir()
    programs.mkdir()
    for name, answer in {"sbatch": "4711;cluster", "squeue": ""}.items():
        path = programs / name
        path.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" >"{tmp_path}/{name}.called"\necho "{answer}"\n')
        path.chmod(0o755)
    (work / "speeds.toml").write_text(STUDY)
    monkeypatch.chdir(work)
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.delenv("PGFMD_HOME", raising=False)
    return tmp_path


def submitted(capsys, *options):
    with pytest.raises(SystemExit) as caught:
        cli.main(["study", "speeds.toml", "--slurm", *options])
    return caught.value.code, *capsys.readouterr()


def in_bash(out, task):
    """What jobs/slurm-array.sh makes of the study's files, with all that comes after left out: words for a run."""
    script = (ROOT / "jobs" / "slurm-array.sh").read_text()
    noted = 'run_pgfmd() { printf "%s\\n" "$@"; }\nend_link() { exit; }'
    script = script.replace('. "$PGFMD_HOME/jobs/batch.bash"', noted)
    assert "batch.bash" not in script
    exports = [line for line in (out / "array.sh").read_text().splitlines() if line.startswith("export ")]
    done = subprocess.run(
        ["bash", "-c", "\n".join([*exports, script])], env=os.environ | {"SLURM_ARRAY_TASK_ID": str(task)},
        capture_output=True, text=True, timeout=10,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_study_is_submitted_as_an_array(folder, capsys):
    code, said, complaints = submitted(capsys, "--sbatch-options", '--time=1:00:00 --comment="a b"', "--jobs", "1")
    out = folder / "my work" / "out" / "speeds"
    assert code == 0 and complaints == "" and "submitted as job 4711: 2 cases" in said
    called = (folder / "sbatch.called").read_text().splitlines()
    assert called == [
        "--parsable", "--array=1-2%1", f"--output={out}/slurm-%A_%a.txt", "--time=1:00:00", "--comment=a b",
        str(out / "array.sh"),
    ]  # fmt: skip
    assert (out / "submitted.txt").read_text() == "4711\n"
    # What the command said can be given again.
    assert shlex.split(next(line for line in said.splitlines() if line.startswith("sbatch")))[1:] == called


def test_the_script_asks_as_that_of_jobs_does(folder, capsys):
    submitted(capsys, "--dry-run")
    out = folder / "my work" / "out" / "speeds"
    option = re.compile(r"^#SBATCH --([a-z-]+)=?(.*)$", re.MULTILINE)
    asked = dict(option.findall((out / "array.sh").read_text()))
    template = dict(option.findall((ROOT / "jobs" / "slurm-array.sh").read_text()))
    own = ("job-name", "ntasks", "mem-per-cpu")
    assert {name: value for name, value in asked.items() if name not in own} == {
        name: value for name, value in template.items() if name not in own
    }
    assert asked["signal"] == "B:USR1@300" and (asked["job-name"], asked["ntasks"]) == ("speeds", "3")
    needed = memory_of(cases_of(read_study("speeds.toml"))[0].scene, 3).peak + PROGRAM_BYTES
    assert 1.5e-6 * needed <= int(asked["mem-per-cpu"].removesuffix("M")) <= 1.5e-6 * needed + 1
    assert subprocess.run(["bash", "-n", out / "array.sh"], timeout=10).returncode == 0
    assert (out / "array.sh").read_text().splitlines()[-1] == '. "$PGFMD_HOME/jobs/slurm-array.sh"'


def test_each_task_is_its_case(folder, capsys):
    submitted(capsys, "--dry-run", "--checkpoint-every", "5min", "--allow", "solver.accuracy")
    out = folder / "my work" / "out" / "speeds"
    for task, case in enumerate(cases_of(read_study("speeds.toml")), 1):
        source, *rest = in_bash(out, task)
        where, options = rest.index("--checkpoint-every"), rest[rest.index("--checkpoint-every") :]
        assert load_scene(source, rest[:where]) == case.scene
        assert options == ["--checkpoint-every", "5min", "--allow", "solver.accuracy", "--out", str(out / case.name)]


def test_a_dry_run_submits_nothing(folder, capsys):
    code, said, _ = submitted(capsys, "--dry-run")
    assert code == 0 and "sbatch --parsable --array=1-2" in said and not (folder / "sbatch.called").exists()
    assert not (folder / "my work" / "out" / "speeds" / "submitted.txt").exists()


def test_what_is_queued_is_not_submitted_again(folder, capsys):
    submitted(capsys)
    (folder / "bin" / "squeue").write_text("#!/bin/sh\necho 4711_1 RUNNING\n")
    for options in ([], ["--dry-run"]):
        code, _, complaints = submitted(capsys, *options)
        assert code == 5 and "job 4711 of this study is still in the queue" in complaints
    # Slurm forgets jobs.
    (folder / "bin" / "squeue").write_text("#!/bin/sh\necho Invalid job id specified >&2; exit 1\n")
    assert submitted(capsys)[0] == 0


@pytest.mark.parametrize(
    ("program", "said"),
    [("#!/bin/sh\necho 'No partition' >&2; exit 1\n", "sbatch refuses (exit code 1): No partition"), ("", "sbatch")],
)
def test_a_sbatch_that_refuses(program, said, folder, capsys):
    (folder / "bin" / "sbatch").write_text(program)
    code, _, complaints = submitted(capsys)
    assert code == 5 and said in complaints


def test_no_sbatch_and_no_job_scripts(folder, capsys, monkeypatch):
    monkeypatch.setenv("PATH", str(folder))
    code, _, complaints = submitted(capsys)
    assert code == 5 and "sbatch is not there" in complaints
    assert submitted(capsys, "--dry-run")[0] == 0
    monkeypatch.setenv("PGFMD_HOME", str(folder))
    code, _, complaints = submitted(capsys, "--dry-run")
    assert code == 5 and "set PGFMD_HOME" in complaints
    code, _, complaints = submitted(capsys, "--dry-run", "--sbatch-options", "'")
    assert code == 5


def test_nothing_in_the_file_of_cases_is_carried_out(folder, capsys):
    submitted(capsys, "--dry-run")
    out = folder / "my work" / "out" / "speeds"
    (out / "cases.txt").write_text(
        "# cases\n\na x.toml \"drive.speed=1 um/s\" 'it'\"'\"'s' b\\ c $(touch PWNED) `touch PWNED` ; $HOME & *\n'open\n"
    )
    words = in_bash(out, 1)
    assert words[:4] == ["x.toml", "drive.speed=1 um/s", "it's", "b c"]
    assert words[4:] == ["$(touch", "PWNED)", "`touch", "PWNED`", ";", "$HOME", "&", "*", "--out", str(out / "a")]
    assert not (folder / "my work" / "PWNED").exists()
    with pytest.raises(AssertionError, match="case 2 can't be read"):
        in_bash(out, 2)


@pytest.mark.parametrize("sign", ["\n", "\t", "\x1b", "\x7f", "\x85"])
def test_control_characters_reach_no_script(sign, folder, capsys):
    scene = f"s{sign}x $(touch PWNED).toml"
    (folder / "my work" / scene).write_text(shipped_text("tri-tack"))
    quoted = scene.encode("unicode_escape").decode().replace("\\x", "\\u00")
    (folder / "my work" / "speeds.toml").write_text(STUDY.replace('"tri-tack"', f'"{quoted}"'))
    code, _, complaints = submitted(capsys, "--dry-run")
    assert code == 2 and "no line feed nor any other control character" in complaints
    assert not (folder / "my work" / "out").exists()
