"""The command line without MPI: what it prints, writes, refuses, and what it must not load."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import pgfmd
from pgfmd import cli
from pgfmd.forecast.advice import warnings as warnings_of
from pgfmd.host import launch
from pgfmd.host.launchers import LEFT_BEHIND, environment_without
from pgfmd.scene import load_scene, shipped_scenes, shipped_text
from tests.unit.synthetic_results import write_results

HEAVY = ("mpi4py.MPI", "numba", "h5py", "matplotlib")


def pgfmd_command(arguments: list[str], folder: Path, **variables: str) -> subprocess.CompletedProcess:
    """`pgfmd` as a user calls it, outside any MPI job; ends with the heavy modules it loaded, on stderr."""
    script = (
        "import atexit, sys\n"
        f"heavy = lambda: [name for name in {HEAVY} if name in sys.modules]\n"
        "atexit.register(lambda: print('loaded', heavy(), file=sys.stderr))\n"
        "from pgfmd.cli import main\n"
        "main()"
    )
    environment = {name: value for name, value in environment_without().items() if not name.startswith("SLURM_")}
    environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "COLUMNS": "100"} | variables
    command = [sys.executable, "-c", script, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=100)


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """`pgfmd` in this process and a folder of its own, where it does not matter what is loaded."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")

    def call(*arguments: str) -> subprocess.CompletedProcess:
        with pytest.raises(SystemExit) as done:
            cli.main(list(arguments))
        said = capsys.readouterr()
        return subprocess.CompletedProcess(arguments, done.value.code, said.out, said.err)

    return call


@pytest.mark.parametrize(
    "arguments",
    [["-h"], ["--version"], ["run", "--help"], ["check", "tri-tack"], ["init", "hertz"], ["bench", "transform", "-h"],
     ["fit-prony", "-h"], ["plot-rheology", "-h"]],
)  # fmt: skip
def test_light_commands_load_nothing_heavy(arguments, tmp_path):
    done = pgfmd_command(arguments, tmp_path)
    assert done.returncode == 0
    assert done.stderr == "loaded []\n"
    assert done.stdout.strip()


def test_version(call):
    assert call("--version").stdout.strip() == pgfmd.__version__


def test_the_version_is_the_same_wherever_it_is_written():
    root = Path(__file__).parents[2]
    declared = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    cited = re.search(r"^version: (.+)$", (root / "CITATION.cff").read_text(encoding="utf-8"), re.M)[1]
    newest = re.search(r"^## (\S+)$", (root / "docs" / "changelog.md").read_text(encoding="utf-8"), re.M)[1]
    assert declared == cited == pgfmd.__version__
    assert declared.removesuffix(".0") == newest


def test_init_writes_the_commented_scene_that_check_and_run_read(call, tmp_path):
    for name in shipped_scenes():
        assert call("init", name).returncode == 0
        path = tmp_path / f"{name}.toml"
        assert path.read_text(encoding="utf-8") == shipped_text(name)
        assert load_scene(str(path)) == load_scene(name)


def test_init_does_not_overwrite(call, tmp_path):
    path = tmp_path / "hertz.toml"
    path.write_text("mine")
    refused = call("init", "hertz")
    assert refused.returncode == 2 and "--force" in refused.stderr and path.read_text() == "mine"
    assert call("init", "hertz", "--force").returncode == 0
    assert path.read_text(encoding="utf-8") == shipped_text("hertz")


def test_init_of_an_unknown_scene_lists_the_known_ones(call, tmp_path):
    done = call("init", "tri-tak")
    assert done.returncode == 2
    assert "did you mean tri-tack?" in done.stderr and all(name in done.stderr for name in shipped_scenes())
    assert not any(tmp_path.iterdir())


def test_check_prints_plain_text_into_a_pipe(tmp_path):
    done = pgfmd_command(["check", "tri-tack", "grid.n=2048", "--set", "drive.speed=5 um/s"], tmp_path)
    assert done.returncode == 0 and "\x1b" not in done.stdout
    words = {" ".join(line.split()[:2]) for line in done.stdout.splitlines()}
    assert {"grid.n 2048", "drive.speed 5e-06", "kappa_inf 250"} <= words
    assert "2.63815e-07" in done.stdout


def test_check_writes_warnings_on_one_line_each(call):
    done = call("check", "tri-tack", "grid.n=64", "drive.preload=10 N")
    warnings = [line for line in done.stdout.splitlines() if line.startswith("warning: ")]
    assert "n >= 80" in warnings[0] and [line for line in warnings if line.endswith("reduce the preload")]
    scene = load_scene("tri-tack", ["grid.n=64", "drive.preload=10 N"])
    assert warnings == [f"warning: {text}" for text in warnings_of(scene)]


def test_check_knows_the_planned_ranks(call):
    done = call("check", "tri-tack", "grid.n=32", "--ranks", "17")
    assert done.returncode == 2 and "use at most 8 ranks" in done.stderr
    assert call("check", "tri-tack", "grid.n=32", "--ranks", "8").returncode == 0


def test_plot_prints_the_pictures(tmp_path):
    write_results(tmp_path / "out", rows=20, nb=8, snapshots=2)
    done = pgfmd_command(["plot", "out"], tmp_path)
    assert done.returncode == 0
    paths = [tmp_path / line for line in done.stdout.split()]
    assert tmp_path / "out" / "force-displacement.png" in paths
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)
    assert "mpi4py" not in done.stderr and "numba" not in done.stderr


def test_plot_of_no_results(call):
    done = call("plot", "nothing")
    assert done.returncode == 4 and "nothing: no such folder" in done.stderr and "Traceback" not in done.stderr


def write_dma(path: Path) -> None:
    omega = [10 ** (0.2 * k - 2) for k in range(31)]
    rows = [f"{w},{2 + 400 * (w * 1e-2) ** 2 / (1 + (w * 1e-2) ** 2)},{4 * w / (1 + (w * 1e-2) ** 2)}" for w in omega]
    path.write_text("\n".join(["omega (rad/s),E' (MPa),E'' (MPa)", *rows]))


def test_fit_prony_prints_or_writes_the_table(call, tmp_path):
    write_dma(tmp_path / "dma.csv")
    done = pgfmd_command(["fit-prony", "dma.csv"], tmp_path)
    assert done.returncode == 0 and done.stderr == "loaded []\n"
    table = tomllib.loads(done.stdout)
    assert list(table) == ["rheology"] and table["rheology"]["model"] == "prony"
    assert table["rheology"]["kappa"] == pytest.approx([200], rel=1e-5)
    assert "misfit" in done.stdout and '# youngs_modulus = "2 MPa"' in done.stdout
    written = call("fit-prony", "dma.csv", "--out", "fit.toml", "--plot", "fit.png")
    assert written.returncode == 0 and "fit.toml written" in written.stdout and "misfit" in written.stdout
    assert (tmp_path / "fit.toml").read_text(encoding="utf-8") == done.stdout
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")
    again = call("fit-prony", "dma.csv", "--out", "fit.toml")
    assert again.returncode == 4 and "exists already" in again.stderr
    assert call("fit-prony", "dma.csv", "--out", "fit.toml", "--force").returncode == 0


def test_fit_prony_warns_and_refuses(call, tmp_path):
    write_dma(tmp_path / "dma.csv")
    text = (tmp_path / "dma.csv").read_text().splitlines()
    (tmp_path / "cut.csv").write_text("\n".join(text[:22]))
    cut = call("fit-prony", "cut.csv")
    assert cut.returncode == 0 and "warning: at the highest frequency tan delta is still" in cut.stderr
    assert "# warning: at the highest frequency" in cut.stdout
    missing = call("fit-prony", "nothing.csv")
    assert missing.returncode == 4 and "nothing.csv: could not be read" in missing.stderr
    wrong = call("fit-prony", "dma.csv", "-t", "25")
    assert wrong.returncode == 2 and "such as 25C or 298K" in wrong.stderr and "Traceback" not in wrong.stderr
    wrong = call("fit-prony", "dma.csv", "--wlf", "8")
    assert wrong.returncode == 2 and "such as 8.86,101.6" in wrong.stderr


def test_plot_rheology_draws_a_scene_and_refuses_an_elastic_one(call, tmp_path):
    done = pgfmd_command(["plot-rheology", "tri-tack", "rheology.modulus_ratio=1000"], tmp_path)
    assert done.returncode == 0 and done.stdout.split() == ["tri-tack-rheology.png"]
    assert (tmp_path / "tri-tack-rheology.png").read_bytes().startswith(b"\x89PNG")
    assert "mpi4py" not in done.stderr and "numba" not in done.stderr
    call("plot-rheology", "tri-tack", "--out", "mine.png")
    assert (tmp_path / "mine.png").exists()
    elastic = call("plot-rheology", "hertz", "rheology.model=elastic", "-o", "no.png")
    assert elastic.returncode == 2 and "expected a modulus that relaxes" in elastic.stderr
    assert not (tmp_path / "no.png").exists()


@pytest.mark.parametrize(
    "arguments", [["run"], ["rnu", "tri-tack"], ["check", "tri-tack", "--ranks", "0"], ["bench", "all"]]
)
def test_usage_errors(arguments, tmp_path):
    # In a process of its own: `run` listens to signals from its very start.
    done = pgfmd_command(arguments, tmp_path)
    assert done.returncode == 2 and "Usage: pgfmd" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "variables",
    [
        {"OMPI_COMM_WORLD_SIZE": "3", "OMPI_COMM_WORLD_RANK": "0"},
        {"PMI_SIZE": "3", "PMI_RANK": "0"},
        {"SLURM_STEP_NUM_TASKS": "3", "SLURM_PROCID": "0"},
    ],
)
def test_a_foreign_launcher_is_named(variables, tmp_path):
    done = pgfmd_command(["run", "tri-tack"], tmp_path, **variables)
    assert done.returncode == 5
    assert "3 processes were started, but each is alone" in done.stderr and not any(tmp_path.iterdir())


def test_of_foreign_processes_one_speaks(tmp_path):
    silent = pgfmd_command(["run", "tri-tack"], tmp_path, PMI_SIZE="3", PMI_RANK="1")
    assert silent.returncode == 5 and "pgfmd:" not in silent.stderr


def test_other_processes_leave_single_commands_alone(tmp_path):
    done = pgfmd_command(["init", "hertz"], tmp_path, OMPI_COMM_WORLD_SIZE="2", OMPI_COMM_WORLD_RANK="1")
    assert done.returncode == 0 and not any(tmp_path.iterdir())


def test_launched_reads_the_environment(monkeypatch):
    for name in list(os.environ):
        if name.startswith((*LEFT_BEHIND, "SLURM_")):
            monkeypatch.delenv(name)
    assert launch.launched() == (1, 0)
    monkeypatch.setenv("SLURM_NTASKS", "8")  # an allocation, not a step
    assert launch.launched() == (1, 0)
    monkeypatch.setenv("PMI_SIZE", "4")
    monkeypatch.setenv("PMI_RANK", "3")
    assert launch.launched() == (4, 3)


def test_bench_prints_its_numbers(tmp_path):
    done = pgfmd_command(["bench", "transform", "--n", "64", "--json"], tmp_path)
    record = json.loads(done.stdout)
    assert list(record) == ["n", "ranks", "effort", "pfft_pair_ms", "fused_pair_ms", "ratio"]
    assert (record["n"], record["ranks"], record["effort"]) == (64, 1, "estimate")
    assert record["ratio"] == pytest.approx(record["fused_pair_ms"] / record["pfft_pair_ms"]) and record["ratio"] > 0


def test_doctor_says_ok_and_fails_with_a_cure(tmp_path):
    done = pgfmd_command(["doctor"], tmp_path)
    assert done.returncode == (1 if "FAIL" in done.stdout else 0)
    lines = done.stdout.splitlines()
    assert any(line.startswith("OK   transform: on 2 ranks") for line in lines)
    # Without mpirun on the path runs on one rank work. A file of this folder is not taken for a library.
    (tmp_path / "numpy.py").write_text("raise SystemExit('mine')")
    # Open MPI wants one even where it starts nothing.
    (tmp_path / "ssh").write_text("#!/bin/sh\n")
    (tmp_path / "ssh").chmod(0o755)
    lost = pgfmd_command(["doctor"], tmp_path, PATH=str(tmp_path), PYTHONSAFEPATH="1")
    assert lost.returncode == 0, lost.stdout
    amiss = [line for line in lost.stdout.splitlines() if line.startswith("NOTE")]
    assert "NOTE mpirun: neither mpirun nor mpiexec is on PATH: runs on one rank only" in amiss
    assert "OK   transform: on 1 rank as NumPy's" in lost.stdout and lost.stdout.count("     cure: ") == len(amiss)


def test_the_package_is_light_and_lazy(tmp_path):
    code = (
        "import sys, pgfmd; light = not {'numpy', 'pydantic', 'mpi4py'} & set(sys.modules); "
        "print(light, pgfmd.load.__module__, pgfmd.load_scene.__module__, 'mpi4py' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["True", "pgfmd.results.reading", "pgfmd.scene.reading", "False"], done.stderr
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        pgfmd.nonsense  # noqa: B018
