"""Streams that are full, closed or without a reader, and terminals that hang up: seen from outside."""

import os
import signal
import subprocess
import sys

import pytest

from pgfmd.files.tables import CURVE
from pgfmd.host import launch
from tests.faults.launching import ENVIRONMENT
from tests.faults.test_processes import LOOP, running

pytestmark = [pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks"), pytest.mark.timeout(120)]

SCENE = ["tri-tack", "grid.n=20", "solver.max_steps=3", "output.snapshots=[]"]
FULL = "standard output can't be written (No space left on device)"
GONE = "standard output can't be written (Broken pipe)"


def in_shell(streams, folder):
    """A run whose streams a shell has redirected."""
    line = f'exec "{sys.executable}" -P -m pgfmd.cli run "$@" {streams}'
    arguments = [*SCENE, "--out", str(folder)]
    return subprocess.run(["bash", "-c", line, "bash", *arguments], env=ENVIRONMENT, capture_output=True, timeout=60)


def is_whole(folder):
    lines = (folder / "curve.csv").read_text().splitlines()
    # Three steps and the start, and nothing that was printed.
    assert len(lines) == 5 and all(line.count(",") + 1 == len(CURVE.titles) for line in lines)
    return (folder / "run.json").is_file() and not (folder / "run.lock").exists()


@pytest.mark.parametrize(
    ("streams", "told"),
    [
        (">/dev/full", FULL),
        ("> >(exec true)", GONE),
        (">/dev/full 2>/dev/full", ""),
        ("<&- >&- 2>&-", ""),
    ],
    ids=["full", "no reader", "both full", "closed"],
)
def test_a_run_outlives_its_streams(streams, told, tmp_path):
    done = in_shell(streams, tmp_path)
    assert done.returncode == 0 and is_whole(tmp_path)
    complaints = done.stderr.decode()
    assert "Traceback" not in complaints and "Exception ignored" not in complaints
    if told == GONE and not complaints:
        # All that there was to say came before its reader's end.
        return
    assert complaints.count(told) == 1 and complaints.count("pgfmd:") == bool(told) if told else not complaints


def test_a_command_whose_answer_is_not_read_or_kept_says_so(tmp_path):
    assert in_shell("", tmp_path).returncode == 0
    status = [sys.executable, "-P", "-m", "pgfmd.cli", "status", str(tmp_path)]
    with open("/dev/full", "wb") as full:
        done = subprocess.run(status, env=ENVIRONMENT, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 4 and done.stderr == "pgfmd: standard output can't be written: No space left on device\n"
    # Nobody reads any more: nothing to say, and no success.
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(status, env=ENVIRONMENT, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(writer)
    assert done.returncode not in (0, 120) and done.stderr == ""


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGXCPU], ids=lambda number: number.name)
def test_a_hang_up_and_a_limit_of_processor_time_ask_to_stop(number):
    with running(LOOP, ranks=1) as job:
        job.send_signal(number)
        told, _ = job.communicate(timeout=15.0)
    name = number.name.removeprefix("SIG")
    assert told == f"rank 0: {name} {name}\n" and job.returncode == 75


def test_a_hang_up_that_is_ignored_stays_so():
    program = "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n" + LOOP
    with running(program, ranks=1) as job:
        job.send_signal(signal.SIGHUP)
        job.send_signal(signal.SIGUSR1)
        told, _ = job.communicate(timeout=15.0)
    assert told == "rank 0: USR1 USR1\n" and job.returncode == 75
