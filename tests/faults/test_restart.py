"""Runs that are signalled, limited in time, killed or short of disk: seen from outside, under hard time limits."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pgfmd.host import launch
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.restart.checkpoint_layout import read_head
from tests.faults.launching import ENVIRONMENT, held_at, wait_for_rows

pytestmark = pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks")

SCENE = ["tri-tack", "grid.n=48", "solver.accuracy=1e-4", "drive.preload=10 mN", 'output.snapshots=["2 s"]']
LASTING = ["grid.n=128", "solver.accuracy=1e-8"]
"""Makes of it one of some minutes, which outlives whatever the tests do meanwhile."""
RESUMABLE = 75
ROOT = Path(__file__).parents[2]


def command(folder: Path, ranks: int, *options: str) -> list[str]:
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return [*launcher, sys.executable, "-m", "pgfmd.cli", "run", *SCENE, "--out", str(folder), *options]


def finish(folder: Path, ranks: int = 1, *options: str, limit: float = 90.0) -> subprocess.CompletedProcess:
    """The run in a folder, to its end."""
    return subprocess.run(
        command(folder, ranks, *options), env=ENVIRONMENT, capture_output=True, text=True, timeout=limit
    )


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """A run that nobody stops: of one rank, as the bits are the same for any number of them."""
    folder = tmp_path_factory.mktemp("undisturbed")
    done = finish(folder)
    assert done.returncode == 0, done.stderr
    return folder


def interrupted(run: list[str], folder: Path, number: int, rows: int = 150) -> subprocess.CompletedProcess:
    """A run that is sent a signal when it has written some rows; it must end by itself."""
    process = subprocess.Popen(run, env=held_at(rows), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        wait_for_rows(folder, rows, process)
        process.send_signal(number)
        said, complaints = process.communicate(timeout=20.0)
    finally:
        process.kill()
    return subprocess.CompletedProcess(process.args, process.returncode, said, complaints)


NAMES = {signal.SIGUSR1: "USR1", signal.SIGTERM: "TERM", signal.SIGINT: "Ctrl-C"}


def steps_kept(folder: Path) -> int:
    """Steps of the newest checkpoint, which the curve must not be ahead of or behind."""
    assert not (folder / "run.json").exists() and not (folder / "run.lock").exists()
    steps = read_head(folder / "checkpoint.h5")["state"]["counters"]["steps"]
    assert (folder / "curve.csv").read_bytes().count(b"\n") == steps + 2
    return steps


@pytest.mark.parametrize(
    ("number", "ranks"),
    [(signal.SIGUSR1, 1), (signal.SIGTERM, 1), (signal.SIGINT, 1), (signal.SIGUSR1, 2)],
    ids=lambda value: value.name if isinstance(value, signal.Signals) else f"{value} ranks",
)
def test_a_signal_stops_a_run_which_then_goes_on_to_the_same_bits(number, ranks, tmp_path, undisturbed):
    stopped = interrupted(command(tmp_path, ranks), tmp_path, number)
    assert stopped.returncode == RESUMABLE
    assert stopped.stderr.count(f"pgfmd: stopped by {NAMES[number]} after step ") == stopped.stderr.count("pgfmd:") == 1
    assert "the same command goes on from there" in stopped.stderr and "Traceback" not in stopped.stderr
    steps = steps_kept(tmp_path)
    done = finish(tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"going on from checkpoint.h5: step {steps}," in done.stdout
    assert differences(undisturbed, tmp_path) == []
    assert [link["ranks"] for link in json.loads((tmp_path / "run.json").read_text())["links"]] == [ranks, 1]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda number: number.name)
def test_mpirun_passes_on_its_own_end_in_time_for_a_checkpoint(number, tmp_path):
    """Late, and always as TERM; its exit code is its own. So the run is a long one, and is stopped in the end."""
    long = [*command(tmp_path, 2), *LASTING]
    stopped = interrupted(long, tmp_path, number)
    assert stopped.stderr.count("pgfmd: stopped by TERM after step ") == stopped.stderr.count("pgfmd:") == 1
    assert stopped.returncode not in (0, RESUMABLE)
    steps = steps_kept(tmp_path)
    stopped = interrupted(long, tmp_path, signal.SIGUSR1, rows=steps + 50)
    assert stopped.returncode == RESUMABLE and f"going on from checkpoint.h5: step {steps}," in stopped.stdout
    assert steps_kept(tmp_path) >= steps + 48


def hears(process: subprocess.Popen, number: int) -> bool:
    """Whether a process has a handler for a signal."""
    try:
        lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    except OSError:
        return False
    caught = next((int(line.split()[1], 16) for line in lines if line.startswith("SigCgt")), 0)
    return bool(caught >> (number - 1) & 1)


def test_signals_before_the_first_step_and_after_the_last_end_nothing(tmp_path, undisturbed):
    """USR2 and USR1 while it loads: it goes on to its first look, and stops there; USR1 again and again: it is stopped
    as it was."""
    process = subprocess.Popen(command(tmp_path, 1), env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        latest = time.monotonic() + 30.0
        while not hears(process, signal.SIGUSR1):
            assert time.monotonic() < latest and process.poll() is None
            time.sleep(0.001)
        process.send_signal(signal.SIGUSR2)
        while process.poll() is None:
            assert time.monotonic() < latest
            process.send_signal(signal.SIGUSR1)
            time.sleep(0.01)
    finally:
        process.kill()
    assert process.returncode == RESUMABLE
    assert steps_kept(tmp_path) == 0
    assert finish(tmp_path).returncode == 0
    assert differences(undisturbed, tmp_path) == []


def test_usr2_saves_and_the_run_goes_on(tmp_path, undisturbed):
    process = subprocess.Popen(
        command(tmp_path, 1, "--checkpoint-every", "off"), env=held_at(150), text=True, stdout=subprocess.PIPE
    )
    try:
        wait_for_rows(tmp_path, 150, process)
        assert not (tmp_path / "checkpoint.h5").exists()
        process.send_signal(signal.SIGUSR2)
        latest = time.monotonic() + 10.0
        while not (tmp_path / "checkpoint.h5").exists():
            assert time.monotonic() < latest
            time.sleep(0.005)
        said, _ = process.communicate(timeout=60.0)
    finally:
        process.kill()
    assert process.returncode == 0 and said.count("checkpoint  t ") == 1
    assert differences(undisturbed, tmp_path) == []


def test_a_limit_of_time_is_kept(tmp_path):
    limit, steps = 5.0, []
    while len(steps) < 2:
        # A run that lasts; it has to end by itself within the limit.
        began = time.monotonic()
        stopped = finish(tmp_path, 1, *LASTING, "--walltime", f"{limit}s", limit=2.0 * limit)
        if stopped.returncode == RESUMABLE and time.monotonic() - began < limit:
            assert f"pgfmd: stopped by the limit of time (--walltime {limit}s) after step " in stopped.stderr
            steps.append(steps_kept(tmp_path))
        else:
            # On a machine so busy that loading took most of it.
            limit *= 2.0
            assert stopped.returncode in (3, RESUMABLE) and limit < 100.0, stopped.stderr
    assert 0 < steps[0] < steps[1] and f"going on from checkpoint.h5: step {steps[0]}," in stopped.stdout


def test_a_limit_that_leaves_no_time_to_step_is_an_error(tmp_path):
    done = finish(tmp_path, 1, "--walltime", "0.1s")
    assert (
        done.returncode == 3 and "the limit of time (--walltime 0.1s) came after 0 steps of this process" in done.stderr
    )


def test_a_second_run_is_refused_and_the_first_unharmed(tmp_path):
    first = subprocess.Popen([*command(tmp_path, 1), *LASTING], env=ENVIRONMENT, stdout=subprocess.PIPE)
    try:
        wait_for_rows(tmp_path, 20, first)
        second = finish(tmp_path)
        assert second.returncode == 4 and second.stderr.count("pgfmd:") == 1
        assert f"{tmp_path}: in use by process {first.pid}" in second.stderr
        assert first.poll() is None
        wait_for_rows(tmp_path, (tmp_path / "curve.csv").read_bytes().count(b"\n") + 20, first)
        first.send_signal(signal.SIGUSR1)
        first.communicate(timeout=20.0)
    finally:
        first.kill()
    assert first.returncode == RESUMABLE


LIMITED = """
import resource, sys
from mpi4py import MPI
from pgfmd.cli import main
MPI.COMM_WORLD.Barrier()
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
main(sys.argv[2:])
"""
"""Files may grow to so many bytes only; but not before MPI has made its own."""


@pytest.mark.parametrize(
    ("size", "what", "ranks"),
    [(30_000, "checkpoint.h5", 1), (80_000, "fields.h5", 1), (30_000, "checkpoint.h5", 2), (80_000, "fields.h5", 2)],
)
def test_a_full_disk_ends_the_run_and_more_room_lets_it_go_on(size, what, ranks, tmp_path, undisturbed):
    whole = command(tmp_path, ranks)
    python = whole.index(sys.executable)
    limited = [*whole[: python + 1], "-c", LIMITED, str(size), *whole[python + 3 :]]
    done = subprocess.run(limited, env=ENVIRONMENT, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 4, done.stderr
    assert done.stderr.count("pgfmd:") == done.stderr.count("could not be written: File too large") == 1
    assert f"{tmp_path}/{what}: could not be written" in done.stderr
    assert not list(tmp_path.glob("*.tmp")) and not (tmp_path / "run.lock").exists()
    if what == "fields.h5":
        read_head(tmp_path / "checkpoint.h5")
    assert finish(tmp_path).returncode == 0
    assert differences(undisturbed, tmp_path) == []


# Runs that go on and are killed again, beside whatever else a machine does.
@pytest.mark.timeout(250)
def test_kills_at_random_times():
    """Two of the two hundred that scripts/studies/restart/torture.py does."""
    done = subprocess.run(
        [sys.executable, "-m", "scripts.studies.restart.torture", "--kills", "2", "--seed", "3"], cwd=ROOT,
        env=ENVIRONMENT, capture_output=True, text=True, timeout=240.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1].startswith("2 kills (") and done.stdout.endswith(": 0 faults\n")
