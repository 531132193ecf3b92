"""Where people run it: terminals, notebooks, their settings and folders; and what is told of an unexpected error."""

from __future__ import annotations

import errno
import io
import json
import os
import shlex
import subprocess
import sys

import pytest

from pgfmd import cli
from pgfmd.commands.run import _summary
from pgfmd.host import faults, launch, streams
from pgfmd.host.launchers import environment_without
from pgfmd.plots.drawing import literal
from tests.unit.synthetic_results import write_results

TITLE = "Δγ = 50 mJ/m² costs $5 or $6^"


@pytest.fixture
def results(tmp_path):
    """A results folder whose title has Greek letters and dollars."""
    folder = write_results(tmp_path / "my run", rows=30, nb=8, snapshots=2)
    (folder / "scene.resolved.toml").write_text(f'title = "{TITLE}"\n', encoding="utf-8")
    return folder


def pgfmd(*arguments, folder, **variables) -> subprocess.CompletedProcess:
    """`python -m pgfmd` in a folder with a numpy.py and a typing.py that are no matter of ours."""
    (folder / "numpy.py").write_text("raise SystemExit('mine')")
    return subprocess.run(
        [sys.executable, "-m", "pgfmd", *map(str, arguments)], cwd=folder, env=environment_without() | variables,
        capture_output=True, timeout=100,
    )  # fmt: skip


def called(capsys, *arguments) -> tuple[int, str]:
    """Exit code, and what is said on both streams, of a command in this process."""
    with pytest.raises(SystemExit) as done:
        cli.main(list(map(str, arguments)))
    said = capsys.readouterr()
    # Typer begins a new line after the ^C of a terminal.
    return done.value.code, (said.out + said.err).lstrip("\n")


def test_any_terminal_takes_any_title(results, tmp_path):
    done = pgfmd("analyse", results, folder=tmp_path, PYTHONIOENCODING="latin-1")
    assert done.returncode == 0 and b"?? = 50 mJ/m\xb2" in done.stdout and done.stderr == b""
    done = pgfmd("analyse", results, "--json", "--out", "elsewhere", folder=tmp_path, PYTHONIOENCODING="ascii")
    assert json.loads(done.stdout)["title"].startswith(TITLE)
    assert (tmp_path / "elsewhere" / "analysis.json").is_file()


def test_pictures_are_not_what_the_user_has_set(results, tmp_path, capsys):
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nfigure.facecolor: black\nsavefig.dpi: 20\n")
    backend = "module://matplotlib_inline.nowhere"
    done = pgfmd("plot", results, "--out", "one", folder=tmp_path, MPLBACKEND=backend, PATH="/nowhere")
    assert done.returncode == 0 and done.stderr == b"", done.stderr
    assert called(capsys, "plot", results, "--out", tmp_path / "two")[0] == 0
    names = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert "force-displacement.png" in names and not list(results.glob("*.png"))
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), name


def test_dollars_of_a_title_are_dollars():
    from matplotlib.cbook import is_math_text

    assert is_math_text(TITLE) and is_math_text(literal(TITLE)) in (False, TITLE)


def test_results_that_cannot_be_written_to_name_the_way_out(results, tmp_path, capsys):
    # Root may write anywhere, but no file over a folder.
    for name in ("force-displacement.png", "analysis-bulges.png", "analysis-compliance.png", "analysis-hysteresis.png"):
        (results / name).mkdir()
    for command in ("plot", "analyse"):
        code, said = called(capsys, command, results)
        assert code == 4 and said.endswith("; --out DIR writes into another folder\n") and said.count("\n") == 1
    assert called(capsys, "plot", results, "--out", tmp_path / "new" / "folder")[0] == 0
    (tmp_path / "file").touch()
    code, said = called(capsys, "plot", results, "--out", tmp_path / "file")
    assert code == 4 and said == f"pgfmd: {tmp_path}/file: could not be made: File exists\n"


@pytest.mark.parametrize(
    "command",
    ["run tri-tack --out ''", "study '' ", "study a.toml --out ''", "converge tri-tack --out ''", "plot ''",
     "plot x --out ''", "plot-rheology tri-tack --out ''", "analyse ''", "analyse x --twin ''",
     "analyse x --asperity ' '", "analyse x --out ''", "compare x ''", "compare x --out ''", "fit-prony ''", "fit-prony x --out ''",
     "fit-prony x --plot ''", "status x ''", "verify ''"],
)  # fmt: skip
def test_an_empty_name_is_refused(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code, said = called(capsys, *shlex.split(command))
    assert code == 2 and "is empty" in said and not list(tmp_path.iterdir())


def test_printed_commands_can_be_pasted(tmp_path, monkeypatch, capsys):
    record = {"finished": "detached", "pull_off_force_N": 1.0, "work_of_separation_J": 1.0, "steps": 1, "work_J": 1.0,
              "transform_pairs": 1, "wall_s": 1.0, "energy_residual": None}  # fmt: skip
    assert _summary(record, tmp_path / "my run")[-1].endswith(f"pgfmd plot '{tmp_path}/my run'")
    (tmp_path / "s.toml").write_text('scene = "tri-tack"\n[axes]\n"drive.speed" = ["1 um/s"]\n')
    code, said = called(capsys, "study", tmp_path / "s.toml", "--dry-run", "--out", tmp_path / "my study")
    assert code == 0, said
    (line,) = (line for line in said.splitlines() if line.strip().startswith("pgfmd run"))
    assert shlex.split(line)[-1].startswith(f"{tmp_path}/my study/") and "drive.speed=1 um/s" in shlex.split(line)


# -- errors that nobody expected ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (OSError(errno.ENOSPC, "No space left", "/disk/file"), 4, "pgfmd: /disk/file: No space left\n"),
        (MemoryError("8 GiB"), 3, "pgfmd: the memory is not enough (8 GiB): take a smaller grid"),
        (ImportError("libfftw3.so.3: cannot open", name="mpi4py_fft"), 1, "pgfmd: a library can't be loaded: libfftw3"),
        (KeyboardInterrupt(), 130, "pgfmd: interrupted\n"),
    ],
)
def test_what_the_system_refuses_is_one_message(error, code, told, monkeypatch, capsys):
    _fail(monkeypatch, error)
    found, said = called(capsys, "verify", "x")
    assert found == code and said.startswith(told) and said.count("\n") == 1


@pytest.mark.parametrize(
    "error", [KeyError("depth"), EOFError("Ran out of input"), ImportError("x", name="pgfmd.nowhere")]
)
def test_a_fault_of_ours_is_one_block_to_report(error, monkeypatch, capsys):
    _fail(monkeypatch, error)
    found, said = called(capsys, "verify", "my run")
    first, *rest = said.splitlines()
    assert found == 1 and first == "pgfmd: this is a fault of pgfmd. Please report it with this block:"
    assert all(line.startswith("  ") for line in rest) and rest[0] == "  asked for: pgfmd verify 'my run'"
    assert "pgfmd 0" in rest[2] and "numpy " in rest[2] and rest[3] == "  Traceback (most recent call last):"
    assert rest[-1].startswith(f"  {type(error).__name__}: ")


def _fail(monkeypatch, error):
    def fail(folder):
        raise error

    monkeypatch.setattr("pgfmd.results.verify.verify", fail)
    monkeypatch.setattr(faults, "_command", None)


def test_a_program_of_somebody_else_has_its_own_traceback(monkeypatch):
    monkeypatch.setattr(faults, "_command", None)
    assert faults.describe(KeyError("mine")) == "KeyError: 'mine'"


def test_names_that_are_no_text_come_out_as_they_are():
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="utf-8")
    streams.forgive(stream)
    stream.write(os.fsdecode(b"caf\xe9") + " \ud800")
    stream.flush()
    assert raw.getvalue() == b"caf\xe9 ?"


def test_ranks_with_a_fault_speak_one_after_the_other(monkeypatch):
    waited = []
    monkeypatch.setattr(faults.time, "sleep", waited.append)
    for rank in (0, 1, 2, 1000):
        faults.take_turn(rank)
    assert waited == sorted(waited) and len(set(waited)) == 3 and waited[-1] < launch.PATIENCE
