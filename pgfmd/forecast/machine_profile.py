"""What `pgfmd bench ranks` has found out about this machine, kept in the user's cache folder; how long a run then takes on
some ranks, and how many ranks it deserves. No MPI."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

import pgfmd
from pgfmd.errors import PgfmdError
from pgfmd.files.regular_files import write_atomically

from .scaling import Costs, Problem, total_seconds

FORMAT = 2
"""Of the file."""
NEARLY = 1.05
"""Fewer ranks are better where they take at most so many times as long: their cores can do something else."""
MEASURE = "`pgfmd bench ranks` measures it in about a minute"


class NoProfile(PgfmdError):
    """There is no profile of this machine that can be used; says why."""


@dataclass(frozen=True)
class Profile:
    """A machine as measured. machine: `identity`; cores: that could be used; measured: the date. start [s]: of a run, by
    its number of ranks. costs: of the work, by the kind of a problem."""

    machine: str
    cores: int
    measured: str
    start: dict[int, float]
    costs: dict[str, Costs]

    def start_seconds(self, ranks: int) -> float:
        """Seconds from the command to the first step; along a line between the numbers of ranks that were measured."""
        known = sorted(self.start)
        return float(np.interp(ranks, known, [self.start[count] for count in known]))

    def run_seconds(self, problem: Problem, pairs: float, ranks: int) -> float:
        """Seconds of a run of so many pairs of transforms, start included."""
        return self.start_seconds(ranks) + pairs * total_seconds(problem, ranks, self.costs[problem.kind])

    @property
    def most_ranks(self) -> int:
        """The most ranks that were measured; of more, nothing is known."""
        return max(self.start)

    def best_ranks(
        self, problem: Problem, pairs: float, cores: int | None = None, more: Callable[[int], float] = lambda ranks: 0.0
    ) -> int:  # fmt: skip
        """The fewest ranks that are `NEARLY` the fastest, out of one to the most that were measured, or to `cores`. more: what
        else the run takes [s] on so many ranks."""
        most = min(cores or self.most_ranks, self.most_ranks, problem.most_ranks)
        seconds = {ranks: self.run_seconds(problem, pairs, ranks) + more(ranks) for ranks in range(1, most + 1)}
        fastest = min(seconds.values())
        return min(ranks for ranks, taken in seconds.items() if taken <= NEARLY * fastest)


def identity() -> str:
    """What tells machines apart: processor and number of cores, as nodes of a kind share a profile."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            # The number of the model, too: several kinds go by one name, in virtual machines at least.
            found = dict(re.findall(r"^(model name|model|stepping)\s*:\s*(.+)$", file.read(1 << 14), re.MULTILINE))
    except OSError:
        found = {}
    name = found.get("model name") or platform.processor() or platform.machine()
    kind = ", ".join(f"{key} {found[key]}" for key in ("model", "stepping") if key in found)
    return f"{name}{f' ({kind})' if kind else ''}, {os.cpu_count()} cores"


def place() -> Path:
    """The file of this machine's profile. NoProfile where there is no folder for it."""
    digest = hashlib.sha256(identity().encode()).hexdigest()[:16]
    try:
        return platformdirs.user_cache_path("pgfmd") / f"machine-{digest}.json"
    except (OSError, RuntimeError) as error:
        raise NoProfile(f"no cache folder of this user: {error}") from None


def write(profile: Profile) -> Path:
    """Keeps the profile of this machine; returns its file. NoProfile where that can't be."""
    path = place()
    content = {"format": FORMAT, "pgfmd": pgfmd.__version__, **asdict(profile)}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, (json.dumps(content, indent=1) + "\n").encode())
    except OSError as error:
        raise NoProfile(f"{path}: the profile of this machine can't be kept: {error.strerror}") from None
    return path


def read() -> Profile:
    """The profile of this machine. NoProfile where there is none, or one of another version or machine."""
    path = place()
    try:
        content = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise NoProfile(f"no profile of this machine: {MEASURE}") from None
    except (OSError, ValueError) as error:
        raise NoProfile(f"{path}: the profile of this machine can't be read ({error}): {MEASURE}") from None
    wanted = {"format": FORMAT, "pgfmd": pgfmd.__version__, "machine": identity()}
    for key, value in wanted.items():
        found = content.get(key) if isinstance(content, dict) else None
        if found != value:
            what = f"{key} = {found!r} and not {value!r}"
            raise NoProfile(f"{path}: a profile of another version or machine, {what}: {MEASURE}")
    try:
        costs = {kind: _costs_in(numbers) for kind, numbers in content["costs"].items()}
        start = {int(ranks): float(seconds) for ranks, seconds in content["start"].items()}
        profile = Profile(content["machine"], int(content["cores"]), str(content["measured"]), start, costs)
        if not (start and costs and profile.cores > 0 and _is_sound(profile)):
            raise ValueError("its numbers make no sense")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise NoProfile(f"{path}: the profile of this machine is damaged ({error}): {MEASURE}") from None
    return profile


def _costs_in(numbers: dict[str, Any]) -> Costs:
    """Costs as the file has them."""
    kept: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in numbers.items()}
    return Costs(**kept)


def _is_sound(profile: Profile) -> bool:
    """Whether all numbers are finite and none is negative, and tables are as long as their axes."""
    if not all(0.0 <= seconds < math.inf for seconds in profile.start.values()):
        return False
    for costs in profile.costs.values():
        tables = (costs.row, costs.column, costs.points, costs.point)
        numbers = [*costs.sizes, *costs.crowding, *(number for table in tables for number in table)]
        numbers += [
            costs.pair_overhead,
            costs.sum_overhead,
            costs.adding,
            costs.sums,
            costs.meeting,
            costs.look,
            costs.shared,
        ]
        lengths = {len(table) for table in (costs.sizes, *tables)}
        if len(lengths) > 1 or 0 in lengths or not all(0.0 <= number < math.inf for number in numbers):
            return False
    return True
