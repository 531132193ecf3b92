"""The batch job of this process, if there is one, and whether another job has ended."""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import dataclass

ANSWER_WITHIN = 5.0
"""Time limit [s] for an answer of a batch system."""
SLURM, PBS = "Slurm", "PBS"
_VARIABLES = {
    SLURM: ("SLURM_JOB_ID", "SLURM_CLUSTER_NAME", "SLURM_RESTART_COUNT"),
    PBS: ("PBS_JOBID", "PBS_SERVER", ""),
    "LSF": ("LSB_JOBID", "LSF_CLUSTER_NAME", ""),
    "Grid Engine": ("JOB_ID", "SGE_CLUSTER_NAME", ""),
}
"""Environment variables with a job's id, its cluster, and how often it was requeued."""
_OVER = {
    *("BOOT_FAIL", "CANCELLED", "COMPLETED", "DEADLINE", "FAILED", "NODE_FAIL", "OUT_OF_MEMORY", "PENDING"),
    *("PREEMPTED", "REVOKED", "TIMEOUT"),
}
"""States of a Slurm job without running processes; a requeued job is pending."""


@dataclass(frozen=True)
class Job:
    """A batch job. cluster: the one that assigned the id. restarts: how often it was requeued."""

    system: str
    id: str
    cluster: str = ""
    restarts: int = 0

    def __str__(self) -> str:
        return f"{self.system} job {self.id}"


def this_job() -> Job | None:
    """The job of this process; None if there is none."""
    for system, (name, cluster, restarts) in _VARIABLES.items():
        if os.environ.get(name):
            count = os.environ.get(restarts, "")
            return Job(system, _id(name), os.environ.get(cluster, ""), int(count) if count.isdecimal() else 0)
    return None


def _id(name: str) -> str:
    """The id of this job; for a task of a Slurm array, array and task number."""
    # One task of an array has the id of the array itself, with which Slurm would answer for all tasks.
    array, task = os.environ.get("SLURM_ARRAY_JOB_ID"), os.environ.get("SLURM_ARRAY_TASK_ID")
    return f"{array}_{task}" if name == "SLURM_JOB_ID" and array and task else os.environ[name]


def is_over(job: Job) -> bool | None:
    """Whether a job's processes have ended; None if that can't be determined here.

    A job that was requeued since then has ended. For other jobs, Slurm of the same cluster is asked.
    """
    here = this_job()
    if here and (here.system, here.cluster, here.id) == (job.system, job.cluster, job.id):
        return True if here.restarts > job.restarts else None
    if job.system != SLURM or job.cluster != (here.cluster if here else _cluster()):
        return None
    done = asked("squeue", "--noheader", "--states=all", f"--jobs={job.id}", "--format=%T")
    if done is None or (done.returncode and "Invalid job id" not in done.stderr):
        return None
    return set(done.stdout.split()) <= _OVER


def _cluster() -> str:
    """The name of the cluster of Slurm's commands, outside of jobs."""
    done = asked("scontrol", "show", "config")
    match = re.search(r"^ClusterName\s*=\s*(\S+)", done.stdout, re.MULTILINE) if done else None
    return match[1] if match else ""


def asked(*command: str, **more: str) -> subprocess.CompletedProcess | None:
    """A batch system's answer to a command; None if there is none within the time limit."""
    # These variables of users change the output of squeue.
    plain = {name: value for name, value in os.environ.items() if not name.startswith("SQUEUE_")}
    try:
        return subprocess.run(
            command,
            env=plain | more,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=ANSWER_WITHIN,
        )
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
