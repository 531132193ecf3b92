"""Ranks and launchers that die, signals, two runs in one folder: small programs, from outside, under hard limits."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from pgfmd.host import launch
from pgfmd.host.run_lock import LOCK_FILE, holder
from tests.faults.launching import ENVIRONMENT

pytestmark = pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks")


@contextmanager
def running(program, *arguments, ranks=2, ready=True):
    """A program under mpirun, or alone; once it has said "ready". Whatever is left of it at the end is killed."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    process = subprocess.Popen(
        [*launcher, sys.executable, "-c", program, *map(str, arguments)],
        env=ENVIRONMENT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        if ready:
            assert process.stdout.readline() == "ready\n", process.stderr.read()
        yield process
    finally:
        process.kill()
        process.communicate()


def alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def all_end(pids):
    """Returns as soon as none of these processes lives, which must be within seconds."""
    latest = time.monotonic() + 3.0
    while any(map(alive, pids)):
        assert time.monotonic() < latest
        time.sleep(0.02)


def pids_in(folder, ranks=2):
    return [int((folder / f"pid.{rank}").read_text()) for rank in range(ranks)]


WAITING = """
import os, sys, time
from pathlib import Path
from pgfmd.host import launch
from pgfmd.host.stop_signals import StopSignals

comm = launch.world()
(Path(sys.argv[1]) / f"pid.{comm.rank}").write_text(str(os.getpid()))
with launch.guarded(comm), StopSignals(comm) as signals:
    signals.patience = float(sys.argv[2])
    comm.Barrier()
    if comm.rank == 0:
        print("ready", flush=True)
    if comm.rank == 1:
        time.sleep(40.0)
    comm.Allreduce(bytearray(8), bytearray(8))
"""


def test_a_killed_rank_ends_the_job(tmp_path):
    with running(WAITING, tmp_path, 6) as job:
        time.sleep(0.2)
        os.kill(pids_in(tmp_path)[1], signal.SIGKILL)
        _, complaints = job.communicate(timeout=10.0)
        assert job.returncode != 0 and "Killed" in complaints
        all_end(pids_in(tmp_path))


def test_a_rank_that_waits_in_vain_ends_itself_after_a_signal(tmp_path):
    # As from a launcher that passes signals on, and kills nobody.
    with running(WAITING, tmp_path, 1) as job:
        time.sleep(0.2)
        os.kill(pids_in(tmp_path)[0], signal.SIGTERM)
        _, complaints = job.communicate(timeout=10.0)
        assert job.returncode == 130
        assert complaints.count("pgfmd: TERM: no end of the step within 1 s") == complaints.count("pgfmd:") == 1


def test_a_second_ctrl_c_ends_at_once(tmp_path):
    with running(WAITING, tmp_path, 1000) as job:
        for wait in (0.0, 1.0):
            time.sleep(wait)
            os.kill(pids_in(tmp_path)[0], signal.SIGINT)
        _, complaints = job.communicate(timeout=10.0)
        assert job.returncode == 130 and complaints.count("pgfmd: Ctrl-C again") == complaints.count("pgfmd:") == 1


def test_a_killed_launcher_leaves_no_rank(tmp_path):
    with running(WAITING, tmp_path, 6) as job:
        assert all(map(alive, pids_in(tmp_path)))
        job.kill()
        all_end(pids_in(tmp_path))


PARENT = """
import os, sys
from pgfmd.host.processes import end_with_launcher
if os.fork():
    os.wait()
else:
    end_with_launcher()
    # PR_GET_PDEATHSIG
    import ctypes
    found = ctypes.c_int()
    ctypes.CDLL(None).prctl(2, ctypes.byref(found), 0, 0, 0)
    print(found.value)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux only")
def test_only_what_a_launcher_has_started_dies_with_it(tmp_path):
    # Nothing is awaited before: a line read ahead of communicate() may take the next one into its buffer.
    with running(PARENT, ranks=1, ready=False) as job:
        assert job.communicate(timeout=20.0)[0] == "0\n"
    done = subprocess.run(
        ["mpirun", "-n", "1", sys.executable, "-c", PARENT.replace("if os.fork()", "if False")],
        env=ENVIRONMENT, text=True, capture_output=True, timeout=20.0,
    )  # fmt: skip
    assert done.stdout == f"{signal.SIGKILL.value}\n", done.stderr


ONE_FAILS = """
import sys, threading, time
from pgfmd.host import launch
from pgfmd.errors import RunError

comm, what = launch.world(), sys.argv[1]
launch.PATIENCE = 1.0

def leave():
    sys.exit(3)

if what == "all exit":
    sys.exit(9)
if what == "all fail":
    raise RunError("nobody can go on")
if comm.rank == 1:
    if what == "exception":
        raise ValueError("lost at sea")
    if what == "exit":
        leave()
    if what == "message":
        sys.exit("cast away")
    if what == "thread":
        thread = threading.Thread(target=lambda: 1 // 0)
        thread.start()
        thread.join()
if what == "caught":
    try:
        leave()
    except SystemExit as error:
        assert error.code == 3
    time.sleep(2.0 * comm.rank)
elif what == "early":
    if comm.rank == 1:
        sys.exit(0)
    time.sleep(2.0)
else:
    comm.Barrier()
"""


@pytest.mark.parametrize(
    ("fault", "code", "texts"),
    [
        ("exception", 1, ["pgfmd: rank 1: error on this rank ends the job", "ValueError: lost at sea"]),
        ("thread", 1, ["pgfmd: rank 1: error on this rank ends the job", "ZeroDivisionError"]),
        ("exit", 3, ["pgfmd: rank 1: exit on this rank ends the job", "in leave"]),
        ("message", 1, ["pgfmd: rank 1: exit on this rank ends the job"]),
        ("all exit", 9, []),
        ("all fail", 1, ["pgfmd.errors.RunError: nobody can go on"]),
        ("none", 0, []),
        ("caught", 0, []),
        ("early", 0, []),
    ],
)
def test_a_script_that_only_asks_for_the_world(fault, code, texts):
    with running(ONE_FAILS, fault, ready=False) as job:
        _, complaints = job.communicate(timeout=15.0)
    assert job.returncode == code, complaints
    for text in texts:
        assert complaints.count(text) == 1, complaints
    assert ("pgfmd: rank" in complaints) == any(text.startswith("pgfmd: rank") for text in texts)


LOOP = """
import sys, time
from mpi4py import MPI
from pgfmd.host import launch
from pgfmd.host.stop_signals import StopSignals

comm = launch.world()
before = [launch.signal.getsignal(number) for number in (2, 10, 12, 15)]
number = 0
with StopSignals(comm) as signals:
    comm.Barrier()
    if comm.rank == 0:
        print("ready", flush=True)
    latest = time.monotonic() + 30.0
    while not number and time.monotonic() < latest:
        time.sleep(0.01)
        number = comm.allreduce(signals.stop, MPI.MAX)
        if comm.allreduce(signals.take_save(), MPI.SUM):
            signals.heard()
            comm.rank or print("saves", flush=True)
    signals.heard()
    here = signals.name_of(signals.stop) if signals.stop else "elsewhere"
    sys.stdout.write(f"rank {comm.rank}: {signals.name_of(number)} {here}\\n")
    sys.stdout.flush()
assert before == [launch.signal.getsignal(number) for number in (2, 10, 12, 15)]
assert launch.signal.set_wakeup_fd(-1) == -1
comm.Barrier()
raise SystemExit(75)
"""


@pytest.mark.parametrize(
    ("number", "ranks", "name", "code"),
    [
        (signal.SIGUSR1, 2, "USR1", 75),
        # mpirun turns Ctrl-C into TERM for its ranks, and has an exit code of its own.
        (signal.SIGTERM, 2, "TERM", 1),
        (signal.SIGINT, 2, "TERM", 1),
        (signal.SIGUSR1, 1, "USR1", 75),
        (signal.SIGTERM, 1, "TERM", 75),
        (signal.SIGINT, 1, "Ctrl-C", 75),
    ],
)
def test_a_request_to_stop_reaches_all_ranks(number, ranks, name, code):
    with running(LOOP, ranks=ranks) as job:
        job.send_signal(number)
        told, _ = job.communicate(timeout=15.0)
    assert sorted(told.splitlines()) == [f"rank {rank}: {name} {name}" for rank in range(ranks)]
    assert job.returncode == code


def test_requests_to_save_let_the_run_go_on():
    with running(LOOP) as job:
        for _ in range(2):
            job.send_signal(signal.SIGUSR2)
            assert job.stdout.readline() == "saves\n"
        # mpirun passes signals on in order; this one comes to its ranks alone.
        job.send_signal(signal.SIGUSR1)
        told, _ = job.communicate(timeout=15.0)
    assert "saves" not in told and told.count("USR1 USR1") == 2


def test_one_rank_that_is_asked_stops_all(tmp_path):
    program = LOOP.replace('print("ready"', 'print(launch.os.getpid(), end=" "); print("ready"')
    with running(program, ready=False) as job:
        os.kill(int(job.stdout.readline().split()[0]), signal.SIGTERM)
        told, _ = job.communicate(timeout=15.0)
    assert sorted(told.splitlines()) == ["rank 0: TERM TERM", "rank 1: TERM elsewhere"] and job.returncode == 75


BESIDE = """
import os, signal, threading
from mpi4py import MPI
from pgfmd.host.stop_signals import StopSignals

def loop():
    with StopSignals(MPI.COMM_WORLD) as signals:
        os.kill(os.getpid(), signal.SIGUSR1)
        print(signals.stop, signals.take_save(), flush=True)
        signals.heard()

signal.signal(signal.SIGUSR1, lambda number, frame: None)
thread = threading.Thread(target=loop)
thread.start()
thread.join()
"""


def test_no_signals_outside_the_main_thread():
    with running(BESIDE, ranks=1, ready=False) as job:
        told, complaints = job.communicate(timeout=15.0)
    assert (told, complaints, job.returncode) == ("0 False\n", "", 0)


LOCKING = """
import sys
from pathlib import Path
from pgfmd.errors import ResultError
from pgfmd.host.run_lock import RunLock

print("ready", flush=True)
input()
try:
    lock = RunLock.acquire(Path(sys.argv[1]), 1)
except ResultError as error:
    print("refused:", error, flush=True)
else:
    print("won", lock.recovered, flush=True)
    input()
    lock.release()
    print("released", flush=True)
"""


def locking(folder):
    process = subprocess.Popen(
        [sys.executable, "-c", LOCKING, str(folder)], env=ENVIRONMENT, text=True, bufsize=1,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout.readline() == "ready\n"
    return process


def say(process, text="\n"):
    process.stdin.write(text)
    process.stdin.flush()


def test_two_runs_in_one_folder(tmp_path):
    first, second, third = (locking(tmp_path) for _ in range(3))
    try:
        say(first)
        assert first.stdout.readline() == "won \n"
        say(second)
        line = second.stdout.readline()
        assert line.startswith(f"refused: {tmp_path}: in use by process {first.pid} on ")
        assert holder(tmp_path).pid == first.pid and holder(tmp_path).alive
        first.kill()
        first.wait(timeout=10.0)
        assert holder(tmp_path).pid == first.pid and holder(tmp_path).alive is False
        say(third)
        assert third.stdout.readline().startswith("won the lock of a run that is gone was taken over: process")
        say(third)
        assert third.stdout.readline() == "released\n" and os.listdir(tmp_path) == []
    finally:
        for process in (first, second, third):
            process.kill()
            process.communicate()


RACE = """
import os, signal, sys, time
from pathlib import Path
from pgfmd.errors import ResultError
from pgfmd.host.run_lock import RunLock, holder

folder = Path(sys.argv[1])
replace = os.replace
# Long enough for the others to come in between.
os.replace = lambda *paths: (time.sleep(0.05), replace(*paths))

def newcomer(go, told):
    pid = os.fork()
    if pid:
        return pid
    os.read(go, 1)
    try:
        lock = RunLock.acquire(folder, 1)
        os.write(told, b"w" if lock.recovered else b"n")
        time.sleep(60.0)
    except ResultError:
        os.write(told, b"r")
    os._exit(0)

expected = "n"
for k in range(20):
    (go, start), (told, tell) = os.pipe(), os.pipe()
    count = 2 + k % 2 if k else 1
    pids = [newcomer(go, tell) for _ in range(count)]
    os.write(start, b"g" * count)
    answers = b"".join(os.read(told, 1) for _ in range(count)).decode()
    print("".join(sorted(answers)), holder(folder).pid in pids, len(os.listdir(folder)))
    # Killed: the next ones find its lock.
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
    for descriptor in (go, start, told, tell):
        os.close(descriptor)
"""


def test_of_several_newcomers_one_takes_a_stale_lock_over(tmp_path):
    with running(RACE, tmp_path, ranks=1, ready=False) as job:
        told, complaints = job.communicate(timeout=60.0)
    assert complaints == ""
    assert told.splitlines() == ["n True 1"] + ["rrw True 1" if k % 2 else "rw True 1" for k in range(1, 20)]
    assert os.listdir(tmp_path) == [LOCK_FILE] and holder(tmp_path).alive is False
