"""Bad scenes, bad folders, a lost rank: seen from outside, through the real command line, under hard time limits."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pgfmd.forecast.estimate import PROGRAM_BYTES, memory_of
from pgfmd.host import launch
from pgfmd.results import load
from pgfmd.scene import load_scene, shipped_text
from tests.faults.launching import ENVIRONMENT

pytestmark = pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks")

PGFMD = [sys.executable, "-m", "pgfmd.cli"]
FREE = 'boundary = "free"'


def started(command: list[str], folder: Path, ranks: int = 1, limit: float = 60.0) -> subprocess.CompletedProcess:
    """A command, on several ranks under mpirun, that must end within the limit [s]."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return subprocess.run(
        [*launcher, *command], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=limit
    )


def scene_with(folder: Path, *replacements: tuple[str, str]) -> None:
    """bad.toml: the shipped tri-tack with some of its texts replaced."""
    text = shipped_text("tri-tack").replace("\nn = 256", "\nn = 32")
    for old, new in replacements:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "bad.toml").write_text(text, encoding="utf-8")


BAD = {
    "wrong dimension": ("drive.speed", ('speed = "1 um/s"', 'speed = "1 um"')),
    "no unit": ("drive.speed", ('speed = "1 um/s"', "speed = 1e-6")),
    "negative": ("punch.amplitude", ('amplitude = "4 um"', 'amplitude = "-4 um"')),
    "NaN": ("adhesion.work_of_adhesion", ('= "50 mJ/m^2"', '= "nan J/m^2"')),
    "infinite": ("rheology.modulus_ratio", ("modulus_ratio = 250", "modulus_ratio = inf")),
    "unknown pattern": ("punch.pattern", ('pattern = "triangular"', 'pattern = "triangle"')),
    "unknown key": ("grid.N", ("\nn = 32", "\nn = 32\nN = 32")),
    "free, too large": ("punch.radius", ('boundary = "periodic"', FREE), ('radius = "375 um"', 'radius = "400 um"')),
    "no such file": (
        "punch.file",
        ('pattern = "triangular"', 'pattern = "file"\nfile = "nowhere.npy"'),
        ('wavelength = "150 um"', ""),
        ('amplitude = "4 um"', ""),
    ),
    "no points": ("grid.n", ("\nn = 32", "\nn = 0")),
    "no preload": ("drive.preload", ('preload = "40 mN"', 'preload = ""')),
}


@pytest.mark.parametrize(
    ("case", "ranks"),
    [*((case, 1) for case in BAD), ("wrong dimension", 2), ("no such file", 2), ("free, too large", 2)],
)
def test_a_bad_scene_ends_in_one_message(case, ranks, tmp_path):
    key, *replacements = BAD[case]
    scene_with(tmp_path, *replacements)
    done = started([*PGFMD, "run", "bad.toml"], tmp_path, ranks)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("pgfmd: bad.toml: 1 problem in this scene") == done.stderr.count("pgfmd:") == 1
    assert done.stderr.count(f"  - {key} = ") == 1
    assert "Traceback" not in done.stderr and done.stdout == ""
    assert os.listdir(tmp_path) == ["bad.toml"]


def test_all_problems_come_at_once(tmp_path):
    scene_with(tmp_path, *(BAD[case][1] for case in ("negative", "NaN", "no points", "no preload")))
    done = started([*PGFMD, "run", "bad.toml"], tmp_path)
    assert done.returncode == 2 and "4 problems" in done.stderr and done.stderr.count("  - ") == 4


def test_a_damaged_topography_names_its_key(tmp_path):
    (tmp_path / "heights.npy").write_bytes(b"\x93NUMPY\x01\x00 no more")
    _, *replacements = BAD["no such file"]
    scene_with(tmp_path, *replacements)
    text = (tmp_path / "bad.toml").read_text(encoding="utf-8").replace("nowhere", "heights")
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    done = started([*PGFMD, "run", "bad.toml"], tmp_path, 2)
    assert done.returncode == 2 and done.stderr.count("  - punch.file = ") == 1 and "Traceback" not in done.stderr
    assert sorted(os.listdir(tmp_path)) == ["bad.toml", "heights.npy"]


def test_more_ranks_than_rows(tmp_path):
    # 4 points a side: 2 rows under the punch, which are a pair
    done = started([*PGFMD, "run", "flat-punch", "grid.n=4"], tmp_path, ranks=3)
    assert done.returncode == 2 and done.stderr.count("use one rank") == 1
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(("folder", "ranks"), [("out", 1), ("/proc/out", 1), ("out/inside", 2)])
def test_a_folder_that_cannot_be_written(folder, ranks, tmp_path):
    """Another file is in the way, of the default folder as well, or nobody may write there."""
    (tmp_path / "out").write_text("a file")
    asked = [] if folder == "out" else ["--out", folder]
    done = started([*PGFMD, "run", "flat-punch", "grid.n=32", *asked], tmp_path, ranks)
    assert done.returncode == 4, done.stderr
    assert done.stderr.count(f"pgfmd: {folder}") == done.stderr.count("pgfmd:") == 1
    assert "Traceback" not in done.stderr and done.stdout == ""
    assert os.listdir(tmp_path) == ["out"] and (tmp_path / "out").read_text() == "a file"


def test_a_preload_out_of_reach_ends_with_valid_results(tmp_path):
    changes = ["grid.n=32", "rheology.model=elastic", "adhesion.law=repulsive", "drive.speed=1 mm/s"]
    done = started([*PGFMD, "run", "flat-punch", *changes, "drive.preload=8 N"], tmp_path, ranks=2)
    assert done.returncode == 0, done.stderr
    assert "The run stopped early: preload not reached." in done.stdout
    folder = tmp_path / "out" / "flat-punch"
    record = json.loads((folder / "run.json").read_text())
    assert record["finished"] == "preload not reached" and record["ranks"] == 2
    curve = load(folder).curve
    assert len(curve) == record["steps"] + 1
    assert curve["indentation [m]"].iloc[-1] > 375e-6 and set(curve["phase"]) == {"approach"}
    # a flat punch, 2 a E* per depth, in series with the overlap K_0 = gamma pi^2/(2 rho^2), soft on a coarse grid
    overlap = 50e-3 * np.pi**2 / (2 * record["range_m"] ** 2) * np.pi * 375e-6**2
    whole = 1 / (1 / (2 * 375e-6 * 2e6 / (1 - 0.495**2)) + 1 / overlap)
    stiffness = (curve["force [N]"].iloc[-1] - curve["force [N]"].iloc[-2]) / curve["indentation [m]"].diff().iloc[-1]
    assert stiffness == pytest.approx(whole, rel=0.05)


def test_results_go_to_out_and_the_name_of_the_scene(tmp_path):
    (tmp_path / "mine.toml").write_text(shipped_text("hertz").replace("\nn = 256", "\nn = 32"), encoding="utf-8")
    first, second, third = (started([*PGFMD, "run", "mine.toml", *more], tmp_path) for more in ([], [], ["--fresh"]))
    assert first.returncode == second.returncode == third.returncode == 0
    assert "this run is finished" in second.stdout
    folder = tmp_path / "out" / "mine"
    record = json.loads((folder / "run.json").read_text())
    assert record["finished"] == "detached"
    foreseen = memory_of(load_scene(str(tmp_path / "mine.toml"))).peak + PROGRAM_BYTES
    # Almost all of it is libraries. How many of their pages count as resident depends on the page cache: 245 to 330 MB
    # were seen of one and the same program. The arrays' share is checked exactly in tests/unit/test_check.py.
    assert 0.6 * foreseen < record["peak_rss_bytes"] < 1.6 * foreseen
    assert (folder / "previous-1" / "run.json").is_file() and "moved to" in third.stdout


RANKS = """
import sys, time
from pgfmd.host import launch
from pgfmd.errors import RunError

comm = launch.world()
with launch.guarded(comm):
    comm.Barrier()
    if sys.argv[1] == "all":
        raise RunError("nobody can go on")
    if comm.rank == 1:
        if sys.argv[1] == "exception":
            raise ValueError("lost at sea")
        if sys.argv[1] == "exit":
            sys.exit(0)
        if sys.argv[1] == "one":
            raise RunError("one can't go on")
    if comm.rank == 0:
        print("ready", flush=True)
    if sys.argv[1] == "wait":
        time.sleep(50)
    comm.Barrier()
"""


@pytest.mark.parametrize(
    ("fault", "code", "message"),
    [
        ("exception", 1, "pgfmd: rank 1: error on this rank ends the job"),
        ("exit", 1, "pgfmd: rank 1: exit on this rank ends the job"),
        ("one", 3, "pgfmd: rank 1: one can't go on"),
        ("all", 3, "pgfmd: nobody can go on"),
    ],
)
def test_a_fault_on_one_rank_ends_the_job(fault, code, message, tmp_path):
    done = started([sys.executable, "-c", RANKS, fault], tmp_path, ranks=2, limit=15.0)
    assert done.returncode == code
    assert done.stderr.count(message) == done.stderr.count("pgfmd: ") == 1
    assert ("ValueError: lost at sea" in done.stderr) == (fault == "exception")


def test_guarded_leaves_a_job_without_faults_alone(tmp_path):
    done = started([sys.executable, "-c", RANKS, "none"], tmp_path, ranks=2, limit=15.0)
    assert done.returncode == 0 and done.stdout == "ready\n"


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_ends_cleanly(number, ranks, tmp_path):
    command = [sys.executable, "-c", RANKS, "wait"]
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    process = subprocess.Popen(
        [*launcher, *command], cwd=tmp_path, env=ENVIRONMENT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        assert process.stdout.readline() == "ready\n"
        sent = time.monotonic()
        process.send_signal(number)
        _, complaints = process.communicate(timeout=15.0)
    finally:
        process.kill()
    assert time.monotonic() - sent < 10.0
    # mpirun has its own exit code after a signal
    assert process.returncode == 130 if ranks == 1 else process.returncode != 0
    assert complaints.count("pgfmd: interrupted. What has been written so far is valid.") == 1
    assert "Traceback" not in complaints
