"""The processes that a run has been the work of, one after the other: each is a link of a chain."""

from __future__ import annotations

import socket
import time
from dataclasses import asdict, dataclass, field

from pgfmd.host import batch


@dataclass
class Link:
    """One process of a run: when and where it began, from which step on, how long it has taken [s], and what it was
    allowed to change."""

    started: str
    host: str
    job: str
    ranks: int
    first_step: int
    versions: dict[str, str]
    changed: list[str] = field(default_factory=list)
    steps: int = 0
    wall_s: float = 0.0
    transform_s: float = 0.0
    checkpoints: int = 0
    checkpoint_s: float = 0.0


class History:
    """The links of a run, the present one last. Goes by rank 0's clock."""

    def __init__(self, ranks: int, versions: dict[str, str], began: float):
        job = batch.this_job()
        started = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        self.now = Link(started, socket.gethostname(), str(job or ""), ranks, 0, versions)
        self.earlier: list[dict] = []
        self._began = began

    def go_on(self, links: list[dict], first_step: int, changed: list[str]) -> None:
        """The run has these links already."""
        self.earlier, self.now.first_step, self.now.changed = links, first_step, changed

    def update(self, steps: int, transform_seconds: float) -> list[dict]:
        """All links, the present one up to date; `steps`: of the whole run."""
        self.now.steps = steps - self.now.first_step
        self.now.wall_s, self.now.transform_s = time.perf_counter() - self._began, transform_seconds
        return [*self.earlier, asdict(self.now)]

    def total(self, name: str) -> float:
        """A time or number, such as "wall_s", over all links."""
        return sum(link[name] for link in [*self.earlier, asdict(self.now)])

    def other_versions(self) -> str:
        """What runs now in other versions than in the link before; empty if nothing does."""
        old, new = (self.earlier[-1]["versions"] if self.earlier else self.now.versions), self.now.versions
        return ", ".join(f"{name} {old.get(name)} -> {new[name]}" for name in new if old.get(name) != new[name])
