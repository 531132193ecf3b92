"""The runs behind the figures: cases of all studies at one size, each scene run once however many studies have it.

Two cases share a run if their scenes are the same but for the title and [output]. The run gets the snapshots of all of
them; its folder is that of the first study that has it, OUT/<study>/<case>.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from pgfmd.parts import confirm
from pgfmd.results import Results, load
from pgfmd.results.curve import Loop
from pgfmd.scene import load_scene
from pgfmd.scene.model import Scene
from pgfmd.studies.cases import Case, cases_of
from pgfmd.studies.study_file import read_study

from . import HERE

SIZES = ("quick", "reduced", "paper")
"""For tests; runs here in minutes; the paper's."""


@dataclass(frozen=True)
class Run:
    """A finished run as a figure sees it: study and name of the case, its scene, its results."""

    study: str
    name: str
    scene: Scene = field(repr=False)
    folder: Path

    @cached_property
    def results(self) -> Results:
        """What the run has written."""
        return load(self.folder)

    @cached_property
    def loop(self) -> Loop:
        """Its force-displacement loop."""
        return Loop.of(self.results, self.name)

    @property
    def preload(self) -> float:
        """Preload [mN], rounded."""
        return round(1e3 * self.scene.drive.preload, 6)

    @property
    def speed(self) -> float:
        """Speed of the approach [um/s], rounded."""
        return round(1e6 * self.scene.drive.speed, 6)

    @property
    def quasistatic(self) -> bool:
        """Whether the run is infinitely slow."""
        return self.scene.solver.scheme == "quasistatic"


@dataclass
class Entry:
    """A run of the pool. owner: "study/case" of the first study that has it; users: all of them."""

    owner: str
    source: str
    overrides: tuple[str, ...]
    users: list[str] = field(default_factory=list)
    snapshots: set[str] = field(default_factory=set)
    surface: bool = False

    def case(self, ranks: int = 1) -> Case:
        """What is run. Raises SceneError."""
        output = (f"output.snapshots={sorted(self.snapshots)!r}", f"output.surface={str(self.surface).lower()}")
        overrides = (*self.overrides, *output)
        scene = load_scene(self.source, overrides)
        confirm(scene, self.owner, ranks)
        return Case(self.owner, self.source, overrides, scene)


def study_cases(study: str, size: str) -> dict[str, Case]:
    """The cases of a study at a size, by their names without it. Raises StudyError."""
    found = {}
    for case in cases_of(read_study(HERE / f"{study}.toml")):
        if case.name.startswith(size):
            found[case.name.removeprefix(size).lstrip("_-") or "run"] = case
    return found


class Pool:
    """All runs of the given studies at a size. extra: overrides for every case, such as "grid.n=64"."""

    def __init__(self, studies: Iterable[str], size: str, extra: Sequence[str] = ()):
        self.size, self.entries, self.cases = size, {}, {}
        for study in studies:
            for name, case in study_cases(study, size).items():
                self._add(f"{study}/{name}", case, tuple(extra))

    def _add(self, user: str, case: Case, extra: tuple[str, ...]) -> None:
        overrides = tuple(text for text in case.overrides if not text.startswith("output."))
        wishes = tuple(text for text in case.overrides if text.startswith("output."))
        bare = load_scene(case.source, [*overrides, *extra, 'title=""', "output.snapshots=[]"])
        key = bare.to_toml()
        entry = self.entries.setdefault(key, Entry(user, case.source, (*overrides, *extra)))
        entry.users.append(user)
        output = load_scene(case.source, [*overrides, *extra, "output.snapshots=[]", *wishes]).output
        entry.snapshots |= set(output.snapshots)
        entry.surface |= output.surface
        self.cases[user] = entry

    def chosen(self, studies: Iterable[str]) -> list[Entry]:
        """The runs that some of the studies need, each once."""
        wanted = tuple(f"{study}/" for study in studies)
        return [entry for entry in self.entries.values() if any(user.startswith(wanted) for user in entry.users)]

    def runs(self, studies: Sequence[str], out: Path, finished: set[str]) -> Runs:
        """The runs of these studies whose owners are among the finished ones."""
        found = []
        for user, entry in self.cases.items():
            study, _, name = user.partition("/")
            if study in studies and entry.owner in finished:
                found.append(Run(study, name, entry.case().scene, out / entry.owner))
        return Runs(found, self.size)


@dataclass(frozen=True)
class Runs:
    """The finished runs of a figure's studies."""

    found: list[Run]
    size: str

    def __iter__(self):
        return iter(self.found)

    def __bool__(self) -> bool:
        return bool(self.found)

    def of(self, study: str = "", name: str = "", **wanted: float) -> list[Run]:
        """The runs of a study, whose name begins with `name`, with these values of preload, speed or quasistatic."""
        return [
            run
            for run in self.found
            if (not study or run.study == study)
            and run.name.startswith(name)
            and all(getattr(run, key) == value for key, value in wanted.items())
        ]

    def one(self, study: str = "", name: str = "", **wanted: float) -> Run | None:
        """The first of them, None if there is none."""
        return next(iter(self.of(study, name, **wanted)), None)
