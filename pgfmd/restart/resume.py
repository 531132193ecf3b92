"""What to do in a results folder: start a run, continue the one in it, or nothing if that is finished.

One process decides before anything is computed. No MPI. A run never silently starts again where there was one.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pgfmd.errors import ResultError
from pgfmd.files import storage
from pgfmd.files.table_reading import count_ends, is_earlier
from pgfmd.solver.simulation import STOPPED_STEPS

from .checkpoint_layout import Damaged, none_valid, read_head
from .scene_changes import DERIVED, contents_of, differing, precision_kept, require_known, review

if TYPE_CHECKING:
    from pgfmd.scene import Scene

OF_EARLIER = (
    "holds a run of version 0.1 of pgfmd, which took a negative gap for contact. This version counts contact in another way "
    "and can't go on with it: finish it with version 0.1, or start anew with --fresh, which keeps the old results"
)
"""Why a run of 0.1 can't be continued: its next rows would define contact differently."""
FAILED = "failed"
"""State in `run.json` of a run that ended with an error; it has an earlier checkpoint."""


@dataclass(frozen=True)
class Plan:
    """What to do.

    go_on: continue from a checkpoint, else start.
    mirror: symmetry of the points in the checkpoint (grid.PunchPoints); None without a checkpoint.
    record: `run.json` of a finished run, for which there is nothing to do.
    messages: lines for the user.
    precision: that of a continued run whose scene leaves it open.
    """

    go_on: bool = False
    mirror: str | None = None
    record: dict | None = None
    messages: list[str] = field(default_factory=list)
    precision: str | None = None

    def scene_of(self, scene: Scene):
        """The scene to run, with the precision that the run began with."""
        if self.precision is None:
            return scene
        return scene.model_copy(update={"solver": scene.solver.chosen(self.precision)})


def plan(folder: Path, scene: Scene, fresh: bool, allow: Sequence[str]) -> Plan:
    """The plan for a folder whose lock is held. If `fresh`, moves old results away.

    Raises SceneError if the scene is not the one that the run began with, or if `allow` has an unknown key; ResultError
    if there are results that can't be continued, with the differences of the scene.
    """
    require_known(allow)
    if fresh:
        aside = storage.set_aside(folder)
        return Plan(messages=[f"{folder} held results: moved to {aside}"] if aside else [])
    checkpoints = [folder / name for name in storage.CHECKPOINT_FILES]
    curve = folder / storage.CURVE_FILE
    if any(path.exists() for path in checkpoints):
        found = _plan_from(folder, checkpoints, scene, allow)
        if found.go_on and curve.exists() and is_earlier(curve):
            raise ResultError(f"{folder}: {OF_EARLIER}")
        return found
    done = _of_finished(folder, finished_record(folder), scene)
    if done:
        # The user may delete the checkpoint of a finished run.
        return done
    if curve.exists() and count_ends(curve) > 2:
        raise ResultError(
            f"{folder}: holds results of a run, but no {storage.CHECKPOINT_FILE} to go on from. Choose another --out, or "
            "start anew with --fresh, which keeps them"
        )
    for name in storage.RESULTS:
        # Left by a run that ended before its first step.
        (folder / name).unlink(missing_ok=True)
    return Plan()


def finished_record(folder: Path) -> dict | None:
    """The record of an ended run, from `run.json`; None if there is none. Raises ResultError if it is damaged."""
    path = folder / storage.RUN_FILE
    try:
        found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
    except ValueError as problem:
        raise ResultError(f"{path}: damaged: {problem}; move it away") from problem
    return None if found is None else storage.require_record(path, found)


def _of_finished(folder: Path, record: dict | None, scene: Scene) -> Plan | None:
    """The plan for a finished run of the same scene without a checkpoint; None if it is not one."""
    if not record or record["finished"] == FAILED:
        return None
    text = (folder / storage.SCENE_FILE).read_text(encoding="utf-8")
    review({"scene": text, "files": contents_of(scene)}, scene, (), folder)
    return Plan(record=record)


def _plan_from(folder: Path, checkpoints: list[Path], scene: Scene, allow: Sequence[str]) -> Plan:
    """The plan if there are checkpoints. Their arrays are checked later, when they are read."""
    head, problems = None, []
    for path in checkpoints:
        try:
            head = read_head(path)
            break
        except Damaged as damage:
            problems.append(f"{path}: {damage}")
        except FileNotFoundError:
            problems.append(f"{path}: missing")
    record = finished_record(folder)
    if head is None:
        # A finished run needs no checkpoint.
        done = _of_finished(folder, record, scene)
        if done:
            return done
        raise none_valid(problems, _scene_differences(folder, scene))
    try:
        changed = review(head, scene, allow, folder)
        finished = head["state"]["finished"]
    except (KeyError, TypeError):
        # A head of another version: reading the state will fail with a message.
        return Plan(go_on=True, mirror=head.get("mirror", ""))
    if finished and record and not (finished == STOPPED_STEPS and "solver.max_steps" in changed):
        return Plan(record=record)
    kept = precision_kept(head["scene"], scene)
    stays = kept is not None and kept != scene.solver.precision
    messages = [f"solver.precision stays {kept!r}, with which this run began"] if stays else []
    # A head without this key is of a run on all points.
    return Plan(go_on=True, mirror=head.get("mirror", ""), messages=messages, precision=kept)


def _scene_differences(folder: Path, scene: Scene) -> str:
    """A line with the keys in which a scene differs from that of the run in a folder; empty if there are none."""
    try:
        text = (folder / storage.SCENE_FILE).read_text(encoding="utf-8")
        found = {key: f"{key} = {now!r}, the run's is {before!r}" for key, before, now in differing(text, scene)}
    except (OSError, ValueError):
        return ""
    messages = [line for key, line in found.items() if key not in DERIVED] or list(found.values())
    return f"The scene is not that of the run, either: {'; '.join(messages)}.\n" if messages else ""
