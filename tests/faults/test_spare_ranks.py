"""Ranks for which there is no core: each rank of these runs may use the same single one."""

import json
import os
import shutil
import signal
import subprocess
import sys

import pytest

from pgfmd.host import launch
from tests.faults.launching import ENVIRONMENT, held_at, wait_for_rows

pytestmark = [
    pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks"),
    pytest.mark.skipif(shutil.which("taskset") is None, reason="needs taskset"),
    pytest.mark.timeout(120),
]

SCENE = ["tri-tack", "grid.n=32", "drive.speed=50 um/s", "drive.preload=2 mN"]


def command(folder, ranks: int, *options: str) -> list[str]:
    core = str(min(os.sched_getaffinity(0)))
    run = [sys.executable, "-m", "pgfmd.cli", "run", *SCENE, "--out", str(folder), *options]
    return ["mpirun", "-n", str(ranks), "taskset", "-c", core, *run]


def environment(**given: str) -> dict[str, str]:
    """That of the other tests, but that ranks without a core are spared."""
    return {name: value for name, value in ENVIRONMENT.items() if name != "PGFMD_ALL_RANKS"} | given


def finish(folder, ranks: int, *options: str, **given: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        command(folder, ranks, *options), env=environment(**given), capture_output=True, text=True, timeout=60
    )


def test_they_wait_and_the_results_are_those_of_all_ranks(tmp_path):
    few, many = finish(tmp_path / "few", 3), finish(tmp_path / "many", 2, PGFMD_ALL_RANKS="1")
    assert few.returncode == many.returncode == 0, few.stderr + many.stderr
    told = "note: 3 ranks, but cores for 1: 1 works and 2 wait"
    assert few.stdout.count(told) == 1 and "note:" not in many.stdout
    records = [json.loads((tmp_path / name / "run.json").read_text()) for name in ("few", "many")]
    assert [record["links"][-1]["ranks"] for record in records] == [1, 2]
    assert (tmp_path / "few/curve.csv").read_bytes() == (tmp_path / "many/curve.csv").read_bytes()


def test_an_error_of_those_that_work_is_told_once_and_ends_all(tmp_path):
    ended = finish(tmp_path / "run", 2, "--walltime", "1ms")
    assert ended.returncode == 3
    assert (
        ended.stderr.count("came after 0 steps of this process") == 1 and "rank" not in ended.stderr.split("-----")[0]
    )


def test_a_signal_to_all_ranks_leaves_a_checkpoint(tmp_path):
    folder = tmp_path / "run"
    process = subprocess.Popen(
        command(folder, 2),
        env={name: value for name, value in held_at(5).items() if name != "PGFMD_ALL_RANKS"},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        wait_for_rows(folder, 5, process)
        process.send_signal(signal.SIGTERM)
        said, complaints = process.communicate(timeout=30)
    finally:
        process.kill()
    assert "note: 2 ranks" in said
    assert "stopped by TERM after step" in complaints and "interrupted" not in complaints
