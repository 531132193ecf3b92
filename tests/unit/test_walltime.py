"""Limits of time as users and batch systems write them."""

import os
import stat
import time

import pytest

from pgfmd.commands import run as run_command
from pgfmd.host import batch
from pgfmd.host.walltime import end_of_job, seconds_of
from pgfmd.units import UnitError

VARIABLES = ("SLURM_", "PBS_", "LSB_", "JOB_ID")


@pytest.fixture
def systems(monkeypatch, tmp_path):
    """No batch job; returns how to put a command of one on the path."""
    for name in [name for name in os.environ if name.startswith(VARIABLES)]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")

    def answers(command, text, code=0):
        path = tmp_path / command
        (tmp_path / "answer").write_text(text)
        path.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/asked\ncat {tmp_path}/answer\nexit {code}\n')
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return tmp_path / "asked"

    return answers


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("23:50:00", 85800.0),
        (" 0:00:01 ", 1.0),
        ("100:00:00", 360000.0),
        ("90:00", 5400.0),
        ("0:59", 59.0),
        ("1-12:00:00", 129600.0),
        ("2-06:30", 196200.0),
        ("90 s", 90.0),
        ("10min", 600.0),
        ("2 h", 7200.0),
        ("0.5 h", 1800.0),
        ("1e3 ms", 1.0),
        ("0 s", 0.0),
    ],
)
def test_times_are_read(text, seconds):
    assert seconds_of(text) == seconds


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("30", '"30" has no unit: write "30 s" or "30 min"'),
        ("", "empty"),
        ("soon", "number"),
        ("1:2:3:4", "is not one"),
        ("1-", "is not one"),
        ("-1:00:00", "is not one"),
        ("1:60:00", "too large a part"),
        ("0:61", "too large a part"),
        ("1-24:00:00", "too large a part"),
        ("-5 s", "is not one"),
        ("inf", "is not one"),
        ("nan s", "is not one"),
        ("3 m", "is a length"),
        ("3 fortnightz", "not known"),
    ],
)
def test_other_texts_are_refused(text, why):
    with pytest.raises(UnitError, match='expected a time, such as "23:50:00"') as refused:
        seconds_of(text)
    assert why in str(refused.value)


def test_without_a_job_there_is_no_end(systems):
    asked = systems("squeue", "1:00")
    assert end_of_job() is None and not asked.exists()


def test_slurm_may_say_when_it_ends(systems, monkeypatch):
    asked = systems("squeue", "1:00")
    monkeypatch.setenv("SLURM_JOB_ID", "77")
    monkeypatch.setenv("SLURM_JOB_END_TIME", "2000000000")
    assert end_of_job() == 2e9 and not asked.exists()


@pytest.mark.parametrize(
    ("answer", "end"),
    [("2000000000\n", 2e9), ("1763793000", 1763793000.0), ("NONE\n", None), ("N/A", None), ("", None)],
)
def test_slurm_is_asked(answer, end, systems, monkeypatch):
    asked = systems("squeue", answer)
    monkeypatch.setenv("SLURM_JOB_ID", "77")
    assert end_of_job() == end
    assert "--jobs=77" in asked.read_text()


@pytest.mark.parametrize(("answer", "end"), [("2000000000", 2e9), ("NONE", 1.6e9)])
def test_an_end_that_has_passed_is_asked_for_again(answer, end, systems, monkeypatch, capsys):
    """A job may get more time while it runs; a shell may outlive its job, and keep what it was told."""
    asked = systems("squeue", answer)
    monkeypatch.setenv("SLURM_JOB_ID", "77")
    monkeypatch.setenv("SLURM_JOB_END_TIME", "1600000000")
    assert end_of_job() == end and asked.exists()
    heeded = run_command._end_of_job()
    assert heeded == (end if end > time.time() else None)
    said = capsys.readouterr().out
    assert ("warning: the time of Slurm job 77 was over 2020-09-1" in said) == (heeded is None)


def test_a_task_of_an_array_asks_for_itself_alone(systems, monkeypatch):
    asked = systems("squeue", "2000000000")
    for name, value in (("SLURM_JOB_ID", "79"), ("SLURM_ARRAY_JOB_ID", "77"), ("SLURM_ARRAY_TASK_ID", "2")):
        monkeypatch.setenv(name, value)
    assert end_of_job() == 2e9 and "--jobs=77_2" in asked.read_text()


def test_a_batch_system_that_fails_or_hangs_says_nothing(systems, monkeypatch, tmp_path):
    monkeypatch.setenv("SLURM_JOB_ID", "77")
    systems("squeue", "1:00", code=1)
    assert end_of_job() is None
    (tmp_path / "squeue").write_text("#!/bin/sh\nexec sleep 30\n")
    monkeypatch.setattr(batch, "ANSWER_WITHIN", 0.2)
    assert end_of_job() is None
    monkeypatch.setenv("PATH", str(tmp_path / "nowhere"))
    assert end_of_job() is None


PBS_PRO = """Job Id: 12.server
    Job_Name = tack
    resources_used.walltime = 00:10:00
    Resource_List.walltime = 01:30:00
    Variable_List = PBS_O_HOME=/home/a,PBS_O_LANG=C,
\tPBS_O_PATH = /usr/bin
    stime = Tue Jan 14 10:00:00 2025
"""


def test_pbs_is_asked(systems, monkeypatch):
    monkeypatch.setenv("PBS_JOBID", "12.server")
    asked = systems("qstat", PBS_PRO)
    assert end_of_job() == time.mktime((2025, 1, 14, 11, 30, 0, 0, 0, -1))
    assert asked.read_text().split() == ["-f", "12.server"]
    systems("qstat", PBS_PRO.replace("    stime", "    Walltime.Remaining = 60\n    stime"))
    assert time.time() + 50.0 < end_of_job() < time.time() + 70.0
    for text in ("", PBS_PRO.replace("stime = Tue", "stime = Some"), PBS_PRO.replace("List.walltime", "List.mem")):
        systems("qstat", text)
        assert end_of_job() is None
