"""The lock on a results folder, and what it takes a run's death from: processes, file locks, batch jobs."""

import errno
import fcntl
import getpass
import json
import os
import socket
import stat
import subprocess
import sys
import time

import pytest

from pgfmd.errors import ResultError
from pgfmd.host import batch, run_lock
from pgfmd.host.mounts import has_common_locks
from pgfmd.host.processes import Process
from pgfmd.host.run_lock import LOCK_FILE, RunLock, holder

DEAD = 2**22 + 1
"""More than the largest number of a process."""


@pytest.fixture(autouse=True)
def _no_batch_job(monkeypatch, tmp_path_factory):
    for name in [name for name in os.environ if name.startswith(("SLURM_", "PBS_", "LSB_", "JOB_ID", "SGE_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("PATH", str(tmp_path_factory.mktemp("bin")))
    monkeypatch.setattr(run_lock, "_MEETING", 0.2)
    monkeypatch.setattr(run_lock, "_SETTLING", 0.05)


def lock_of(folder, **changes):
    """Writes the lock of a run on this host that is dead, with changes."""
    record = {
        "host": socket.gethostname(), "pid": DEAD, "started": 1, "boot": Process.this().boot, "job": None,
        "user": getpass.getuser(), "ranks": 4, "since": "2025-01-14 10:00:00", "command": ["pgfmd"], "guarded": False,
    } | changes  # fmt: skip
    (folder / LOCK_FILE).write_text(json.dumps(record))


def on_another_host(**changes):
    return {"host": "elsewhere", "boot": "other", **changes}


def slurm(identifier, restarts=0, cluster=""):
    return {"system": "Slurm", "id": identifier, "cluster": cluster, "restarts": restarts}


def no_flock(descriptor, how):
    raise OSError(errno.ENOTSUP, "Operation not supported")


def refused(folder, text):
    """A newcomer is refused with this text, and leaves the folder as it was."""
    before = (folder / LOCK_FILE).read_bytes()
    with pytest.raises(ResultError) as caught:
        RunLock.acquire(folder, 1)
    assert str(folder) in str(caught.value) and text in str(caught.value)
    assert os.listdir(folder) == [LOCK_FILE] and (folder / LOCK_FILE).read_bytes() == before


def recovered(folder):
    """A newcomer takes over; returns the line that it has to say."""
    lock = RunLock.acquire(folder, 1)
    assert os.listdir(folder) == [LOCK_FILE] and holder(folder).pid == os.getpid()
    lock.release()
    assert os.listdir(folder) == []
    return lock.recovered


def test_a_lock_says_whose_it_is(tmp_path):
    assert holder(tmp_path) is None
    lock = RunLock.acquire(tmp_path, 4)
    there = holder(tmp_path)
    assert (there.host, there.pid, there.job, there.ranks) == (socket.gethostname(), os.getpid(), "", 4)
    assert there.alive is True and lock.recovered == ""
    assert abs(time.mktime(time.strptime(there.since, "%Y-%m-%d %H:%M:%S")) - time.time()) < 60.0
    assert os.listdir(tmp_path) == [LOCK_FILE]
    lock.release()
    lock.release()
    assert holder(tmp_path) is None and os.listdir(tmp_path) == []


def test_a_second_run_is_refused_and_the_first_unharmed(tmp_path):
    lock = RunLock.acquire(tmp_path, 1)
    for _ in range(2):
        refused(tmp_path, f"in use by process {os.getpid()} on {socket.gethostname()}, of ")
    lock.release()
    RunLock.acquire(tmp_path, 1).release()


@pytest.mark.parametrize("changes", [{}, {"pid": os.getpid()}, {"pid": os.getpid(), "boot": "before"}, {"pid": 0}])
def test_a_process_that_is_gone_leaves_a_stale_lock(changes, tmp_path):
    # Process number of this one, but started at another time; after another start of the machine; damaged.
    lock_of(tmp_path, **changes)
    assert holder(tmp_path).alive is False
    line = recovered(tmp_path)
    assert line.startswith("the lock of a run that is gone was taken over: ")
    assert f"process {changes.get('pid', DEAD)} on" in line or changes == {"pid": 0}


def test_a_process_that_lives_keeps_its_lock_without_flock(tmp_path):
    process = Process.this()
    lock_of(tmp_path, pid=process.pid, started=process.started)
    assert holder(tmp_path).alive is True
    refused(tmp_path, "Wait until it has ended")
    lock_of(tmp_path, pid=process.pid, started=None)
    refused(tmp_path, "Wait until it has ended")


def test_a_zombie_is_dead():
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    process = Process(socket.gethostname(), child.pid, None, "")
    assert process.is_alive() is True
    child.stdin.close()
    latest = time.monotonic() + 20.0
    while process.is_alive():
        assert time.monotonic() < latest
        time.sleep(0.01)
    # Nobody has asked for its exit code so far.
    assert os.path.exists(f"/proc/{child.pid}") == sys.platform.startswith("linux")
    child.wait()
    assert process.is_alive() is False


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"pid": "1"}', '{"host": "a", "pid": 1.5}', "\0" * 500])
def test_a_damaged_lock_is_stale(text, tmp_path):
    (tmp_path / LOCK_FILE).write_text(text)
    assert holder(tmp_path).alive is False
    assert ("damaged" in recovered(tmp_path)) == bool(text)


@pytest.mark.parametrize("text", [None, "", "{"])
def test_what_somebody_keeps_locked_is_in_use(text, tmp_path):
    lock_of(tmp_path)
    if text is not None:
        (tmp_path / LOCK_FILE).write_text(text)
    with open(tmp_path / LOCK_FILE) as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert holder(tmp_path).alive is True
        refused(tmp_path, "Wait until it has ended")
    recovered(tmp_path)


def test_a_run_on_another_host_is_believed_to_live(tmp_path):
    lock_of(tmp_path, **on_another_host())
    assert holder(tmp_path).alive is None
    refused(tmp_path, f"If that run is gone, remove {tmp_path / LOCK_FILE}")


def test_a_lock_of_another_host_is_stale_where_file_locks_are_common(tmp_path, monkeypatch):
    lock_of(tmp_path, **on_another_host(guarded=True))
    monkeypatch.setattr(run_lock, "has_common_locks", lambda folder: False)
    refused(tmp_path, "as far as can be told from here")
    monkeypatch.setattr(run_lock, "has_common_locks", lambda folder: True)
    assert "on elsewhere" in recovered(tmp_path)
    lock_of(tmp_path, **on_another_host(guarded=True))
    with open(tmp_path / LOCK_FILE) as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        refused(tmp_path, "Wait until it has ended")


def test_a_requeued_job_takes_over_from_itself(tmp_path, monkeypatch):
    monkeypatch.setenv("SLURM_JOB_ID", "77")
    lock_of(tmp_path, **on_another_host(job=slurm("77")))
    refused(tmp_path, "Slurm job 77")
    monkeypatch.setenv("SLURM_RESTART_COUNT", "1")
    assert "Slurm job 77" in recovered(tmp_path)
    lock_of(tmp_path, **on_another_host(job=slurm("77", restarts=1)))
    refused(tmp_path, "If that run is gone")


@pytest.mark.parametrize(
    ("answer", "over"),
    [
        ("exit 0", True),
        ("echo COMPLETED", True),
        ("echo PENDING", True),
        ("echo RUNNING", False),
        ("echo COMPLETING", False),
        ("echo slurm_load_jobs error: Invalid job id specified >&2; exit 1", True),
        ("echo Unable to contact slurm controller >&2; exit 1", False),
        ("exec sleep 30", False),
        (None, False),
    ],
)
def test_slurm_is_asked_for_another_job(answer, over, tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "ANSWER_WITHIN", 5.0 if over else 0.5)
    commands = tmp_path / "commands"
    commands.mkdir()
    if answer:
        (commands / "squeue").write_text(f"#!/bin/sh\n{answer}\n")
        (commands / "squeue").chmod(stat.S_IRWXU)
    monkeypatch.setenv("PATH", f"{commands}:/usr/bin:/bin" if answer else str(commands))
    monkeypatch.setenv("SLURM_JOB_ID", "99")
    folder = tmp_path / "out"
    folder.mkdir()
    lock_of(folder, **on_another_host(job=slurm("77")))
    if over:
        assert "Slurm job 77" in recovered(folder)
    else:
        refused(folder, "If that run is gone")
    # Of another user, whose jobs may be hidden; of another cluster, whose ids are others.
    lock_of(folder, **on_another_host(job=slurm("77"), user="somebody else"))
    refused(folder, "If that run is gone")
    lock_of(folder, **on_another_host(job=slurm("77", cluster="far")))
    refused(folder, "If that run is gone")


def test_nobody_comes_between_a_look_at_a_stale_lock_and_its_replacement(tmp_path, monkeypatch):
    lock_of(tmp_path)
    replace = os.replace

    def replace_late(source, target):
        monkeypatch.setattr(os, "replace", replace)
        with pytest.raises(ResultError, match="in use by process"):
            RunLock.acquire(tmp_path, 1)
        replace(source, target)

    monkeypatch.setattr(os, "replace", replace_late)
    assert "taken over" in recovered(tmp_path)


def test_a_stale_lock_that_was_replaced_meanwhile_is_looked_at_again(tmp_path, monkeypatch):
    lock_of(tmp_path)
    look, winners = run_lock._open, []

    def look_early(path):
        found = look(path)
        monkeypatch.setattr(run_lock, "_open", look)
        winners.append(RunLock.acquire(tmp_path, 7))
        return found

    monkeypatch.setattr(run_lock, "_open", look_early)
    with pytest.raises(ResultError, match="in use by process"):
        RunLock.acquire(tmp_path, 1)
    assert "taken over" in winners[0].recovered and holder(tmp_path).ranks == 7
    winners[0].release()
    assert os.listdir(tmp_path) == []


def test_this_job_is_in_the_lock(tmp_path, monkeypatch):
    monkeypatch.setenv("PBS_JOBID", "12.server")
    lock = RunLock.acquire(tmp_path, 2)
    assert holder(tmp_path).job == "PBS job 12.server"
    lock.release()


def test_without_flock_processes_decide(tmp_path, monkeypatch):
    monkeypatch.setattr(fcntl, "flock", no_flock)
    lock = RunLock.acquire(tmp_path, 1)
    refused(tmp_path, "in use by process")
    lock.release()
    lock_of(tmp_path)
    assert "taken over" in recovered(tmp_path)


def test_without_flock_the_last_of_several_newcomers_wins(tmp_path, monkeypatch):
    monkeypatch.setattr(fcntl, "flock", no_flock)
    lock_of(tmp_path)
    sleep = time.sleep
    process = Process.this()

    def another_comes(seconds):
        sleep(seconds)
        lock_of(tmp_path, pid=process.pid, started=process.started)

    monkeypatch.setattr(run_lock.time, "sleep", another_comes)
    with pytest.raises(ResultError, match="at the same time"):
        RunLock.acquire(tmp_path, 1)
    assert json.loads((tmp_path / LOCK_FILE).read_text())["command"] == ["pgfmd"]


@pytest.mark.parametrize("flock", [True, False])
def test_file_systems_without_second_names(flock, tmp_path, monkeypatch):
    def no_link(source, target):
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_link)
    if not flock:
        monkeypatch.setattr(fcntl, "flock", no_flock)
    lock = RunLock.acquire(tmp_path, 1)
    assert lock.recovered == "" and holder(tmp_path).pid == os.getpid()
    refused(tmp_path, "in use by process")
    lock.release()
    assert os.listdir(tmp_path) == []
    lock_of(tmp_path)
    assert "taken over" in recovered(tmp_path)


def test_release_leaves_the_lock_of_another(tmp_path):
    lock = RunLock.acquire(tmp_path, 1)
    (tmp_path / LOCK_FILE).unlink()
    other = RunLock.acquire(tmp_path, 1)
    lock.release()
    assert holder(tmp_path).alive is True
    refused(tmp_path, "in use")
    other.release()
    (tmp_path / "sub").mkdir()
    gone = RunLock.acquire(tmp_path / "sub", 1)
    (tmp_path / "sub" / LOCK_FILE).unlink()
    (tmp_path / "sub").rmdir()
    gone.release()


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in ("nowhere", "file"):
        with pytest.raises(ResultError, match=f"{folder}/run.lock: could not be written: "):
            RunLock.acquire(tmp_path / folder, 1)


def test_what_was_left_behind_is_removed(tmp_path):
    old, new = (tmp_path / f"{LOCK_FILE}.{digit * 32}.tmp" for digit in "0f")
    for file in (old, new):
        file.write_text("")
    os.utime(old, (0, 0))
    RunLock.acquire(tmp_path, 1).release()
    assert os.listdir(tmp_path) == [new.name]


MOUNTS = """22 1 254:0 / / rw,relatime shared:1 - ext4 /dev/vda rw
30 22 0:50 / /home rw,relatime - nfs4 server:/home rw,vers=4.2,local_lock=none
31 22 0:51 / /old rw - nfs server:/old rw,vers=3,nolock,local_lock=all
32 22 0:52 / /scratch rw - lustre mgs@tcp:/scratch rw,flock,user_xattr
33 22 0:53 / /work rw - lustre mgs@tcp:/work rw,localflock
34 22 0:54 / /far\\040away rw - fuse.sshfs host:/ rw
35 22 0:55 / /twice rw - fuse.sshfs host:/ rw
36 22 0:56 / /twice rw - xfs /dev/vdb rw
a damaged line
"""


@pytest.mark.parametrize(
    ("folder", "common"),
    [
        ("/var/out", True), ("/home/a/out", True), ("/homeless", True), ("/old/out", False), ("/scratch/out", True),
        ("/work/out", False), ("/far away/out", False), ("/twice", True),
    ],
)  # fmt: skip
def test_mounts_tell_who_sees_file_locks(folder, common):
    assert has_common_locks(folder, MOUNTS) is common


def test_nothing_known_of_mounts(tmp_path):
    assert has_common_locks(tmp_path, "") is False
