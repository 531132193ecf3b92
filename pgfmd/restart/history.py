"""The processes that have worked on a run, one after the other. Each is a link of a chain."""

from __future__ import annotations

import socket
import time
from dataclasses import asdict, dataclass, field

from pgfmd.host import batch


@dataclass
class Link:
    """One process of a run: when and where it started, its first step, its times [s], and the keys that it was allowed
    to change."""

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
    """The links of a run, the present one last. Times are those of rank 0's clock."""

    def __init__(self, ranks: int, versions: dict[str, str], began: float):
        job = batch.this_job()
        started = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        self.now = Link(started, socket.gethostname(), str(job or ""), ranks, 0, versions)
        self.earlier: list[dict] = []
        self._began = began

    def go_on(self, links: list[dict], first_step: int, changed: list[str]) -> None:
        """Adds the earlier links of a continued run."""
        self.earlier, self.now.first_step, self.now.changed = links, first_step, changed

    def update(self, steps: int, transform_seconds: float) -> list[dict]:
        """Updates the present link, and returns all; steps: of the whole run."""
        self.now.steps = steps - self.now.first_step
        self.now.wall_s, self.now.transform_s = time.perf_counter() - self._began, transform_seconds
        return [*self.earlier, asdict(self.now)]

    def total(self, name: str) -> float:
        """Sum of a field, such as "wall_s", over all links."""
        return sum(link[name] for link in [*self.earlier, asdict(self.now)])

    def other_versions(self) -> str:
        """Software whose version differs from that in the last link, as text; empty if there is none."""
        old, new = (self.earlier[-1]["versions"] if self.earlier else self.now.versions), self.now.versions
        return ", ".join(f"{name} {old.get(name)} -> {new[name]}" for name in new if old.get(name) != new[name])
