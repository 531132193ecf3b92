"""A study as an array of Slurm jobs: its file of cases, and the job script, around jobs/slurm-array.sh. No MPI."""

from __future__ import annotations

import math
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pgfmd
from pgfmd.errors import PgfmdError, ResultError
from pgfmd.files import storage
from pgfmd.files.regular_files import write_atomically
from pgfmd.host.batch import asked

from .campaign import Campaign, make_folder
from .cases import Case
from .values import slug

CASES, SCRIPT, SUBMITTED = "cases.txt", "array.sh", "submitted.txt"
TEMPLATE = "jobs/slurm-array.sh"
SPARE = 1.5
"""Requested memory relative to the forecast of a run."""
_OPTION = re.compile(r"#SBATCH --(?P<name>[a-z-]+)(?:=(?P<value>\S+))?")


class SlurmError(PgfmdError):
    """Slurm is missing, or refuses the array."""

    exit_code = 5


def submit(campaign: Campaign, ranks: int, jobs: int | None, name: str, options: str, dry_run: bool) -> None:
    """Writes OUT/cases.txt and OUT/array.sh for unfinished cases, and submits the array, in which each case is a chain
    of jobs.

    jobs: how many may run at once; options: further ones of sbatch. dry_run: submits nothing. Raises SlurmError if
    sbatch is missing or refuses, or if an array of this study is still in the queue.
    """
    if not dry_run and shutil.which("sbatch") is None:
        raise SlurmError("sbatch is not there: submit on a machine with Slurm; --dry-run writes the files alone")
    _require_no_array(campaign)
    states = campaign.states()
    chosen = campaign.agenda(states)
    campaign.tell(states)
    if not chosen:
        campaign.say("nothing to submit")
        campaign.conclude({}, "")
        return
    make_folder(campaign.out)
    out = campaign.out.resolve()
    home = home_of_jobs()
    _write(out / CASES, cases_text(campaign, chosen))
    _write(out / SCRIPT, script_text(home, out, ranks, memory_per_rank(chosen, ranks), name))
    limit = f"%{jobs}" if jobs else ""
    # % has a special meaning in the names of Slurm's output files.
    output_option = f"--output={str(out).replace('%', '%%')}/slurm-%A_%a.txt"
    command = [
        "sbatch",
        "--parsable",
        f"--array=1-{len(chosen)}{limit}",
        output_option,
        *_split(options),
        str(out / SCRIPT),
    ]
    campaign.say(shlex.join(command))
    if dry_run:
        return
    campaign.clear_folders(chosen, states)
    number = _submitted(command)
    _write(out / SUBMITTED, f"{number}\n")
    cases = "1 case" if len(chosen) == 1 else f"{len(chosen)} cases"
    campaign.say(f"submitted as job {number}: {cases}, each a chain of jobs; see squeue, and --collect at any time")


def cases_text(campaign: Campaign, cases: Sequence[Case]) -> str:
    """The file of cases for jobs/slurm-array.sh: in each line a folder, then the arguments of `pgfmd run`."""
    lines = [f"{case.name} {campaign.quoted(case)}" for case in cases]
    head = "# Written by pgfmd study. A line is a case: its folder, then what pgfmd run is given."
    return "\n".join([head, *lines, ""])


def script_text(home: Path, out: Path, ranks: int, megabytes: int, name: str) -> str:
    """The job script: jobs/slurm-array.sh with its requests to Slurm and its settings."""
    own = {"job-name": slug(name) or "pgfmd", "ntasks": str(ranks), "mem-per-cpu": f"{megabytes}M"}
    try:
        template = (home / TEMPLATE).read_text(encoding="utf-8")
    except OSError as error:
        raise ResultError(f"{home / TEMPLATE}: could not be read: {storage.reason(error)}") from error
    asked_for = {match["name"]: match["value"] for match in _OPTION.finditer(template)} | own
    directives = [f"#SBATCH --{option}" + (f"={value}" if value else "") for option, value in asked_for.items()]
    settings = {"PGFMD_HOME": str(home), "CASES": str(out / CASES), "RESULTS": str(out)}
    exports = [f"export {variable}={shlex.quote(value)}" for variable, value in settings.items()]
    head = [
        "#!/bin/bash",
        "# Written by pgfmd study, which submits it with the --array that fits cases.txt. Options of sbatch win.",
    ]
    return "\n".join([*head, *directives, *exports, f'. "$PGFMD_HOME/{TEMPLATE}"', ""])


def memory_per_rank(cases: Sequence[Case], ranks: int) -> int:
    """Memory [MB] to request per rank: 1.5 times the forecast for the largest case."""
    from pgfmd.forecast.estimate import PROGRAM_BYTES, memory_of

    largest = max(memory_of(case.scene, ranks).peak for case in cases)
    return math.ceil(SPARE * (largest + PROGRAM_BYTES) / 1e6)


def home_of_jobs() -> Path:
    """The folder with pgfmd's sources and its jobs/: $PGFMD_HOME, else where this module is. Raises SlurmError."""
    named = os.environ.get("PGFMD_HOME")
    home = Path(os.path.expanduser(named)).resolve() if named else Path(pgfmd.__file__).resolve().parents[1]
    if not (home / TEMPLATE).is_file():
        raise SlurmError(f"{home / TEMPLATE} is not there: set PGFMD_HOME to the folder with pgfmd's sources")
    return home


def _require_no_array(campaign: Campaign) -> None:
    """Tasks of a queued array read their cases when they start, so its file must not change."""
    path = campaign.out / SUBMITTED
    number = path.read_text(encoding="utf-8").strip() if path.is_file() else ""
    if not re.fullmatch(r"\d+", number):
        return
    # squeue fails for a job that Slurm no longer knows.
    found = asked("squeue", "--noheader", f"--jobs={number}", "--format=%i %T")
    if found is not None and found.returncode == 0 and found.stdout.strip():
        raise SlurmError(f"job {number} of this study is still in the queue: wait for it, or scancel {number}")


def _split(options: str) -> list[str]:
    try:
        return shlex.split(options)
    except ValueError as error:
        raise SlurmError(f"--sbatch-options {options!r}: {error}") from None


def _submitted(command: list[str]) -> str:
    """The number of the job of the array."""
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", timeout=120
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise SlurmError(f"sbatch: {error}") from None
    if done.returncode:
        raise SlurmError(f"sbatch refuses (exit code {done.returncode}): {done.stderr.strip() or done.stdout.strip()}")
    # NUMBER or NUMBER;CLUSTER.
    return done.stdout.strip().splitlines()[-1].partition(";")[0] if done.stdout.strip() else ""


def _write(path: Path, text: str) -> None:
    try:
        write_atomically(path, text.encode())
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {storage.reason(error)}") from error
