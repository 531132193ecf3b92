"""A study whose jobs are real runs on two ranks: interrupted and gone on with, to the bits of undisturbed runs."""

import signal
import subprocess
import sys
import time

import pytest

from pgfmd.host import launch
from pgfmd.restart.bitwise_comparison import differences
from tests.faults.launching import ENVIRONMENT, held_at

pytestmark = pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks")

SCENE = ["tri-tack", "grid.n=32", "solver.accuracy=1e-2", 'output.snapshots=["2 s"]']
STUDY = """
scene = "tri-tack"
set = { grid.n = 32, solver.accuracy = 1e-2, output.snapshots = ["2 s"] }
axes.drive.preload = ["2 mN", "1 mN"]
run = { ranks = 2, jobs = 1 }
"""
CASES = {"preload-2mN": "2 mN", "preload-1mN": "1 mN"}
FIRST, SECOND = CASES
ALONE = f"""
import sys
from mpi4py import MPI
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
for name, preload in {CASES}.items():
    run_scene(load_scene(sys.argv[1], [*sys.argv[2:], "drive.preload=" + preload]), MPI.COMM_SELF, name)
"""


def study(folder, environment=ENVIRONMENT):
    command = [sys.executable, "-m", "pgfmd.cli", "study", "study.toml", "--out", "out"]
    return subprocess.Popen(
        command, cwd=folder, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def rows(folder):
    curve = folder / "curve.csv"
    return curve.read_bytes().count(b"\n") if curve.is_file() else 0


def test_an_interrupted_study_goes_on_to_the_same_bits(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    process = study(tmp_path, held_at(15))
    try:
        latest = time.monotonic() + 60.0
        while rows(tmp_path / "out" / FIRST) < 15:
            assert time.monotonic() < latest and process.poll() is None, process.communicate()
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        said, complaints = process.communicate(timeout=30.0)
    finally:
        process.kill()
    assert process.returncode == 75, complaints
    assert "Ctrl-C: stopping 1 job with a checkpoint" in said and "0 of 2 cases are finished" in complaints
    assert f"[1/2] {FIRST}: stopped with a checkpoint" in said and f"{SECOND}: started" not in said
    assert (tmp_path / "out" / FIRST / "checkpoint.h5").is_file()
    assert not (tmp_path / "out" / FIRST / "run.lock").exists()
    process = study(tmp_path)
    try:
        said, complaints = process.communicate(timeout=90.0)
    finally:
        process.kill()
    assert process.returncode == 0 and complaints == "", complaints
    # On one rank: the bits are the same for any number of them.
    subprocess.run([sys.executable, "-c", ALONE, *SCENE], cwd=tmp_path, env=ENVIRONMENT, timeout=60, check=True)
    for name in CASES:
        assert differences(tmp_path / name, tmp_path / "out" / name) == []
    assert "going on from checkpoint.h5" in (tmp_path / "out" / f"{FIRST}.log").read_text()
