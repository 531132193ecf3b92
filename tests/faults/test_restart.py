"""Runs that are signalled, limited in time, killed or short of disk: seen from outside, under hard time limits."""

import json
import signal
import subprocess
import sys
import time
from operator import itemgetter
from pathlib import Path
from types import SimpleNamespace

import pytest

from pgfmd.host import launch
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.restart.checkpoint_layout import read_head
from scripts.studies.restart import torture
from tests.faults.launching import ENVIRONMENT, held_at, wait_for_rows

pytestmark = pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks")

SCENE = ["tri-tack", "grid.n=48", "solver.accuracy=2e-3", "drive.preload=5 mN", 'output.snapshots=["2 s"]']
"""About 190 steps."""
MIDDLE = 60
"""Lines of a curve that is under way."""
LASTING = ["grid.n=128", "solver.accuracy=1e-8"]
"""Makes of it one of some minutes, which outlives whatever the tests do meanwhile."""
RESUMABLE = 75


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


def interrupted(
    run: list[str], folder: Path, number: int, rows: int = MIDDLE, steps: int = MIDDLE
) -> subprocess.CompletedProcess:
    """A run that is sent a signal when its curve has some rows, and waits for it after some steps; it must end by itself."""
    process = subprocess.Popen(run, env=held_at(steps), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
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
    ("numbers", "ranks"),
    [((signal.SIGUSR1, signal.SIGTERM, signal.SIGINT), 1), ((signal.SIGUSR1,), 2)],
    ids=["1 rank", "2 ranks"],
)
def test_signals_stop_a_run_which_then_goes_on_to_the_same_bits(numbers, ranks, tmp_path, undisturbed):
    for number in numbers:
        rows = (steps_kept(tmp_path) if number != numbers[0] else 0) + MIDDLE // 2
        stopped = interrupted(command(tmp_path, ranks), tmp_path, number, rows, MIDDLE // 2)
        assert stopped.returncode == RESUMABLE
        said = f"pgfmd: stopped by {NAMES[number]} after step "
        assert stopped.stderr.count(said) == stopped.stderr.count("pgfmd:") == 1
        assert "the same command goes on from there" in stopped.stderr and "Traceback" not in stopped.stderr
    steps = steps_kept(tmp_path)
    done = finish(tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"going on from checkpoint.h5: step {steps}," in done.stdout
    assert differences(undisturbed, tmp_path) == []
    links = [link["ranks"] for link in json.loads((tmp_path / "run.json").read_text())["links"]]
    assert links == [*[ranks] * len(numbers), 1]


def test_mpirun_passes_on_its_own_end_in_time_for_a_checkpoint(tmp_path):
    """Late, and always as TERM; its exit code is its own. So the run is a long one, of short steps. What the first end
    leaves is gone on with until the second."""
    long, steps = [*command(tmp_path, 2), "solver.accuracy=1e-8"], [0]
    for number in (signal.SIGTERM, signal.SIGINT):
        stopped = interrupted(long, tmp_path, number, rows=steps[-1] + MIDDLE)
        assert stopped.stderr.count("pgfmd: stopped by TERM after step ") == stopped.stderr.count("pgfmd:") == 1
        assert stopped.returncode not in (0, RESUMABLE)
        assert (f"going on from checkpoint.h5: step {steps[-1]}," in stopped.stdout) == (number == signal.SIGINT)
        steps.append(steps_kept(tmp_path))
    assert 0 < steps[1] < steps[2]


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
        while not (hears(process, signal.SIGUSR1) and hears(process, signal.SIGUSR2)):
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
        command(tmp_path, 1, "--checkpoint-every", "off"), env=held_at(MIDDLE), text=True, stdout=subprocess.PIPE
    )
    try:
        wait_for_rows(tmp_path, MIDDLE, process)
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
    limit, steps = 4.0, []
    while len(steps) < 2:
        # A run that lasts; it has to end by itself within the limit.
        began, before = time.monotonic(), steps_kept(tmp_path) if steps else 0
        stopped = finish(tmp_path, 1, *LASTING, "--walltime", f"{limit}s")
        if stopped.returncode == RESUMABLE and time.monotonic() - began < limit:
            assert f"pgfmd: stopped by the limit of time (--walltime {limit}s) after step " in stopped.stderr
            steps.append(steps_kept(tmp_path))
        else:
            # On a machine so busy that loading took most of it.
            limit *= 2.0
            assert stopped.returncode in (3, RESUMABLE) and limit < 100.0, stopped.stderr
    # An attempt in between may have been too short to count.
    assert 0 < steps[0] <= before < steps[1] and f"going on from checkpoint.h5: step {before}," in stopped.stdout


def test_a_limit_that_leaves_no_time_to_step_is_an_error(tmp_path):
    done = finish(tmp_path, 1, "--walltime", "0.1s")
    assert (
        done.returncode == 3 and "the limit of time (--walltime 0.1s) came after 0 steps of this process" in done.stderr
    )


def test_a_second_run_is_refused_and_the_first_unharmed(tmp_path):
    # It waits while the second one comes, until it is asked to save.
    first = subprocess.Popen([*command(tmp_path, 1), *LASTING], env=held_at(20), stdout=subprocess.PIPE)
    try:
        wait_for_rows(tmp_path, 20, first)
        second = finish(tmp_path)
        assert second.returncode == 4 and second.stderr.count("pgfmd:") == 1
        assert f"{tmp_path}: in use by process {first.pid}" in second.stderr
        assert first.poll() is None
        first.send_signal(signal.SIGUSR2)
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


# Files that are full on some ranks are in tests/parallel/test_storage.py.
@pytest.mark.parametrize(("size", "what", "ranks"), [(30_000, "checkpoint.h5", 1), (80_000, "fields.h5", 2)])
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


def test_kills_leave_a_checkpoint_from_which_the_run_goes_on_to_the_same_bits(tmp_path, undisturbed, monkeypatch):
    """A rank, then mpirun, in the middle of a run: what scripts/studies/restart/torture.py does at random times."""
    for name, value in held_at(MIDDLE).items():
        monkeypatch.setenv(name, value)
    tally = torture.Tally()
    for kills, victim in enumerate((2, 0)):
        job = torture.Job(tmp_path, 2, tuple(SCENE), "10ms")
        wait_for_rows(tmp_path, MIDDLE + kills * (MIDDLE - 10), job.process)
        torture.strike(job, tmp_path, SimpleNamespace(choice=itemgetter(victim)), "held", tally)
        assert tally.wrong == [] and (tmp_path / "checkpoint.h5").exists()
    assert tally.kinds == {"rank": 1, "mpirun": 1} and "going on from checkpoint" in job.output()
    assert finish(tmp_path).returncode == 0
    assert differences(undisturbed, tmp_path) == []
