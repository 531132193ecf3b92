"""Time limits in the formats of batch systems, and the end of this job. No MPI."""

from __future__ import annotations

import contextlib
import math
import os
import re
import time

from pgfmd.units import UnitError, parse_quantity

from . import batch

LIMIT_OF_TIME = "the limit of time"
"""Name of the time limit as a reason for stopping, in messages and in checkpoints."""
_EXPECTED = 'a time, such as "23:50:00" (h:min:s), "1-12:00:00" (days before it) or "90 min"'
_CLOCK = re.compile(r"(?:(?P<days>\d+)-)?(?P<fields>\d+(?::\d+){1,2})")


def seconds_of(text: str) -> float:
    """Seconds of "23:50:00", "90:00" (min:s), "1-12:00:00", or of a quantity such as "90 s", "10min" or "2 h".

    Raises UnitError for anything else: also for a number without unit, which means minutes for Slurm and seconds for
    PBS, and for infinite or negative times.
    """
    text = text.strip()
    if re.fullmatch(r"[\d:-]*[:-][\d:-]*", text):
        return clock_seconds(text)
    if re.fullmatch(r"\d+", text):
        raise UnitError(_EXPECTED, f'"{text}" has no unit: write "{text} s" or "{text} min"')
    try:
        value = parse_quantity(text, "time")
    except UnitError as error:
        raise UnitError(_EXPECTED, error.cure) from None
    if not 0.0 <= value < math.inf:
        raise UnitError(_EXPECTED, f'"{text}" is not one')
    return value


def clock_seconds(text: str) -> float:
    """Seconds of h:min:s or min:s; after "days-", of h:min:s or h:min. Raises UnitError for anything else."""
    match = _CLOCK.fullmatch(text)
    if match is None:
        raise UnitError(_EXPECTED, f'"{text}" is not one')
    days, fields = match["days"], [int(field) for field in match["fields"].split(":")]
    if len(fields) == 2:
        fields = [*fields, 0] if days else [0, *fields]
    # Only the first number may exceed its range, as in "90:00".
    hours, minutes, seconds = fields
    if seconds > 59 or (minutes > 59 and (hours or days)) or (days and hours > 23):
        raise UnitError(_EXPECTED, f'"{text}" has too large a part')
    return 86400.0 * int(days or 0) + 3600.0 * hours + 60.0 * minutes + seconds


def end_of_job() -> float | None:
    """When (time.time()) the batch system ends this job; None without a job or a limit, or if unknown. This may be in
    the past: a shell may survive its job and keep the environment.

    May take seconds, because the batch system is asked; for rank 0 only.
    """
    job = batch.this_job()
    if job is None:
        return None
    if job.system == batch.SLURM:
        known = os.environ.get("SLURM_JOB_END_TIME", "")
        known_end = float(known) if known.isdecimal() and int(known) else None
        if known_end is not None and known_end > time.time():
            return known_end
        # The limit may have been extended after the job began.
        return _end_by_squeue(job.id) or known_end
    return _end_by_qstat(job.id) if job.system == batch.PBS else None


def _end_by_squeue(job: str) -> float | None:
    """When Slurm ends the job. (The remaining time, %L, follows the limit in minutes, and is wrong if the end was
    changed.)"""
    done = batch.asked("squeue", "--noheader", f"--jobs={job}", "--format=%e", SLURM_TIME_FORMAT="%s")
    # It may be NONE or N/A.
    found = done.stdout.strip() if done and not done.returncode else ""
    return float(found) if found.isdecimal() else None


def _end_by_qstat(job: str) -> float | None:
    """End of a PBS job: from its start and its limit, or, with Torque, from the remaining time."""
    done = batch.asked("qstat", "-f", job)
    if not done or done.returncode:
        return None
    # Long lines continue after a tab.
    lines = done.stdout.replace("\n\t", "").splitlines()
    found = dict(re.findall(r"^\s*([\w.]+) = (.*)$", line)[0] for line in lines if " = " in line)
    if found.get("Walltime.Remaining", "").isdecimal():
        return time.time() + float(found["Walltime.Remaining"])
    with contextlib.suppress(KeyError, ValueError):
        began = time.strptime(found["stime"], "%a %b %d %H:%M:%S %Y")
        return time.mktime(began) + clock_seconds(found["Resource_List.walltime"])
    return None
