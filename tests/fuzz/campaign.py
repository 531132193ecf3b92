"""Many scenes one after the other, or on several workers, and what is told of them at the end."""

from __future__ import annotations

import multiprocessing
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from pgfmd.errors import RunError, SceneError
from pgfmd.scene.model import Scene
from pgfmd.scene.reading import parse_scene
from pgfmd.scene_objects import confirm

from .draw import Draw
from .faults import Fault
from .files import write_files
from .judging_checks import judge_check, judge_spelling
from .judging_results import judge_folder
from .relations import AGREES, DIFFERS, RELATIONS, Pair
from .running import OUT_OF_TIME, Ended, in_child, pgfmd, spare_memory, warm_up
from .scenes import Made, make

CHECK_LIMIT = 30.0
"""Time [s] in which a scene has to be read and reported."""
EXAMPLES = 3
"""Scenes that are named for each kind of fault."""


@dataclass
class Finding:
    """What came of a scene: its number, the outcome in a word, its faults, where its files are, if they are kept, and
    the processor time [s] that it took in a process of its own."""

    index: int
    outcome: str
    faults: list[Fault] = field(default_factory=list)
    place: str = ""
    cost: float = 0.0


def check(made: Made, folder: Path, limit: float | None = CHECK_LIMIT) -> Finding:
    """Reads and judges one scene, whose files are in a folder."""
    verdict = judge_check(made.text, folder, limit)
    if verdict.outcome == "fine":
        verdict.faults += judge_spelling(Draw("spelling", made.seed, made.index), made.scene, folder)
    return Finding(made.index, verdict.outcome, verdict.faults)


def run(made: Made, folder: Path, limit: float) -> Finding:
    """Runs one scene in a process and a folder of its own; judges what it said and wrote."""
    prepare(made, folder)

    def action() -> tuple[str, list[Fault]]:
        code, said = pgfmd("run", "scene.toml", "--out", "results")
        try:
            scene = parse_scene(made.text, folder=folder)
            confirm(scene, "scene.toml")
            refused = False
        except SceneError:
            scene, refused = None, True
        except Exception:
            # The run has died of the same, and has told it.
            scene, refused = None, code == SceneError.exit_code
        faults = judge_folder(Path("results"), scene, code, said)
        if refused != (code == SceneError.exit_code):
            faults.append(Fault("check and run do not agree", f"exit code {code}: {said[-300:]}"))
        if scene is not None and code == RunError.exit_code:
            faults += cured(scene, said)
        if scene is None and Path("results").exists():
            faults.append(Fault("refused, but a folder was made", str(sorted(Path("results").iterdir()))[:200]))
        return _outcome(code), faults

    return _finding(made, folder, in_child(action, folder, limit))


def cured(scene: Scene, said: str) -> list[Fault]:
    """Follows the advice of a run that failed, in the folder of its scene: a smaller accuracy, where that is told."""
    if "solver.accuracy" not in said:
        return []
    for share in (0.1, 0.01):
        accuracy = max(1e-8, share * scene.solver.accuracy)
        code, _ = pgfmd("run", "scene.toml", f"solver.accuracy={accuracy!r}", "--out", f"cured-{share}")
        if code != RunError.exit_code:
            return []
    return [Fault("a failed run whose cure is none", f"solver.accuracy down to {accuracy:.3g}: {said.strip()[-300:]}")]


def relate(made: Made, folder: Path, limit: float, only: str | None = None) -> Finding:
    """Runs one scene in two ways that must agree, which its number chooses."""
    prepare(made, folder)
    names = [name for name, relation in RELATIONS.items() if relation.applies(made)]
    name = only or Draw("relation", made.seed, made.index).choice(names)
    if name not in names:
        return Finding(made.index, f"{name}: does not apply")

    def action() -> tuple[str, list[Fault]]:
        pair = Pair(made, folder)
        outcome, found = RELATIONS[name].examine(pair)
        faults = [Fault(f"{name}: {one.label}", one.text) for one in found]
        if outcome in (AGREES, DIFFERS):
            # Both may be wrong in the same way.
            changes = ["output.every=1"] if name == "every" else []
            scene = parse_scene(made.text, changes, folder=folder)
            faults += judge_folder(folder / "base", scene, 0, pair.said)
        return f"{name}: {outcome}", faults

    ended = in_child(action, folder, limit)
    return _finding(
        made, folder, replace(ended, outcome=ended.outcome if ":" in ended.outcome else f"{name}: {ended.outcome}")
    )


def prepare(made: Made, folder: Path) -> None:
    """A folder with the scene and the files that it names."""
    shutil.rmtree(folder, ignore_errors=True)
    write_files(folder, made.natural.length)
    (folder / "scene.toml").write_text(made.text, encoding="utf-8")


def _outcome(code: int) -> str:
    return {0: "finished", 2: "refused", 3: "failed", 75: OUT_OF_TIME}.get(code, f"exit code {code}")


def _finding(made: Made, folder: Path, ended: Ended) -> Finding:
    """Keeps the folder only where there is a fault."""
    if not ended.faults:
        shutil.rmtree(folder, ignore_errors=True)
        return Finding(made.index, ended.outcome, cost=ended.cost)
    return Finding(made.index, ended.outcome, ended.faults, str(folder / "scene.toml"), ended.cost)


@dataclass(frozen=True)
class Campaign:
    """Scenes `indices` of a seed. what: "check", "run" or "relate". folder: for what is kept. limit [s]: of a scene.
    only: the one relation that is looked at, or None. each: whether every scene is told, not only those with faults."""

    what: str
    seed: int
    indices: tuple[int, ...]
    folder: Path
    limit: float
    only: str | None = None
    each: bool = False

    def one(self, index: int) -> Finding:
        made = make(self.seed, index, self.what)
        place = self.folder / made.name
        if self.what == "check":
            finding = check(made, self.folder / "files", self.limit)
            if finding.faults:
                path = self.folder / f"{made.name}.toml"
                path.write_text(made.text, encoding="utf-8")
                finding.place = str(path)
            return finding
        return run(made, place, self.limit) if self.what == "run" else relate(made, place, self.limit, self.only)

    def again(self, index: int) -> str:
        """The command that repeats one scene."""
        only = f" --only {self.only}" if self.only else ""
        return f"python -m tests.fuzz {self.what} --seed {self.seed} --index {index}{only}"


def findings(campaign: Campaign, workers: int) -> Iterator[Finding]:
    """Examines all scenes, on several workers beside each other; in no order where there is more than one."""
    campaign.folder.mkdir(parents=True, exist_ok=True)
    if campaign.what == "check":
        write_files(campaign.folder / "files")
    if workers == 1:
        _ready()
        yield from map(campaign.one, campaign.indices)
        return
    with multiprocessing.get_context("fork").Pool(workers, _ready) as pool:
        yield from pool.imap_unordered(campaign.one, campaign.indices)


def _ready() -> None:
    spare_memory()
    warm_up()


def tell(campaign: Campaign, found: Iterable[Finding], say: Callable[[str], None] = print) -> int:
    """Tells faults as they come and the sum at the end, or on Ctrl-C; returns the number of scenes with faults."""
    told: list[Finding] = []
    labels: dict[str, list[int]] = {}
    try:
        for finding in found:
            told.append(finding)
            if campaign.each:
                say(f"{finding.index}: {finding.outcome}, {finding.cost:.1f} s")
            for fault in finding.faults:
                seen = labels.setdefault(fault.label, [])
                seen.append(finding.index)
                if len(seen) <= EXAMPLES:
                    say(f"FAULT {fault}\n      scene {finding.place}\n      again {campaign.again(finding.index)}")
            sys.stdout.flush()
    except KeyboardInterrupt:
        say(f"\ninterrupted after {len(told)} of {len(campaign.indices)} scenes")
    wrong = sum(bool(finding.faults) for finding in told)
    say(f"\n{campaign.what}, seed {campaign.seed}: {len(told)} scenes, {wrong} with faults")
    if campaign.what != "check" and told:
        most = max(told, key=lambda finding: finding.cost)
        total = sum(finding.cost for finding in told)
        say(f"processor time {total:.0f} s, {most.cost:.1f} s for scene {most.index}")
    for outcome, count in sorted(Counter(finding.outcome for finding in told).items()):
        say(f"  {count:6d}  {outcome}")
    for label, indices in sorted(labels.items(), key=lambda item: -len(item[1])):
        say(f"  FAULT {len(indices):6d}  {label} (scenes {', '.join(map(str, sorted(indices)[:8]))})")
    return wrong
