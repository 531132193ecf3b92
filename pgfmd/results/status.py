"""How the run in a results folder stands, at a glance: its state, how it ended, what is left. No MPI, no fields.

Only heads of checkpoints and the end of the curve are read, so that a hundred folders of large runs take seconds. Ages
and rates come from the times of files, which one server gives to all of them: the clocks of nodes may differ.
"""

from __future__ import annotations

import time
import tomllib
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pgfmd.errors import SceneError
from pgfmd.files import storage
from pgfmd.files.table_reading import CurveTail, count_ends
from pgfmd.files.tables import CurveRow
from pgfmd.forecast.progress import Moment, outlook
from pgfmd.parts import drive_of
from pgfmd.restart.resume import OF_EARLIER
from pgfmd.scene import Scene, parse_scene
from pgfmd.schemes import registry

from .inventory import Checkpoint, Inventory, take_inventory

RUNNING, FINISHED, RESUMABLE, DAMAGED, EMPTY = "running", "finished", "resumable", "damaged", "empty"
GOOD_SPAN = 10.0
"""Time [s] over which a rate is averaged, if available."""
LEAST_SPAN = 1.0
"""Least time [s] over which a rate is averaged."""
LOST_AFTER = 3600.0
"""Time [s] without new data after which a run on another host may be dead."""


@dataclass
class Status:
    """How a run stands. What is not known, or does not apply, is None.

    why: how it finished, why it ended, what is wrong. time_s [s], steps, displacement_m [m], force_N [N], phase: while
    it is running, those of now, else those from which it would go on. row_age_s [s]: how long ago the curve's last row
    was written. checkpoint: the newest valid one. wall_s [s]: of all links, up to the checkpoint. steps_per_s and
    punch_m_per_s [m/s]: per second of wall time. progress: share of the punch's way. left_s [s]: wall time, guessed as
    progress.py says; left_remark: what it leaves out, or why there is none.
    """

    folder: str
    state: str
    why: str = ""
    warnings: list[str] = field(default_factory=list)
    title: str | None = None
    ranks: int | None = None
    links: int | None = None
    holder: dict[str, Any] | None = None
    phase: str | None = None
    time_s: float | None = None
    steps: int | None = None
    displacement_m: float | None = None
    force_N: float | None = None
    preload_N: float | None = None
    row_age_s: float | None = None
    checkpoint: dict[str, Any] | None = None
    wall_s: float | None = None
    steps_per_s: float | None = None
    punch_m_per_s: float | None = None
    progress: float | None = None
    left_s: float | None = None
    left_remark: str = ""

    def as_json(self) -> dict[str, Any]:
        """The status as JSON can hold it."""
        return storage.plain(asdict(self))


def status_of(folder: Path) -> Status:
    """The status of a results folder. ResultError if it is none, or can't be read."""
    found = take_inventory(folder)
    if found is None:
        return Status(str(folder), EMPTY, "no run yet")
    state, why = _state_of(found)
    status = Status(str(folder), state, why, [found.problem] if found.problem else [])
    if found.tail and found.tail.strange:
        strange = f"{found.tail.strange} of its last lines are no rows"
        status.warnings.append(f"{found.tail.path}: {strange}: `pgfmd verify` it")
    if found.tail and found.tail.earlier and state == RESUMABLE:
        status.warnings.append(f"{folder}: {OF_EARLIER}")
    _describe(status, found)
    if state in (RUNNING, RESUMABLE):
        _look_ahead(status, found)
    return status


def _state_of(found: Inventory) -> tuple[str, str]:
    """State, and why."""
    valid, finished = found.valid, found.finished
    over = valid.state["finished"] if valid else ""
    if over and finished and not (found.holder and found.holder.alive):
        # Even if its lock is still there: the record comes last.
        return FINISHED, over
    if found.in_use:
        return RUNNING, "" if found.holder.alive else _doubt(found)
    if valid is not None:
        ending = f"{over}, only its record is missing" if over else _ending(found)
        return RESUMABLE, f"failed: {found.failure}" if found.failure else ending
    if found.checkpoints:
        wrong = "; ".join(f"{one.path.name}: {one.problem}" for one in found.checkpoints)
        return DAMAGED, f"{f'finished ({finished}), but ' if finished else ''}no checkpoint is valid: {wrong}"
    if finished:
        # Its checkpoints were deleted, which is fine.
        return FINISHED, finished
    failed = f"; failed: {found.failure}" if found.failure else ""
    if found.rows_from(0) > 2:
        return DAMAGED, f"results, but no checkpoint to go on from{failed}"
    return EMPTY, f"ended before its first step{failed}"


def _doubt(found: Inventory) -> str:
    """What is known of a run on another host."""
    files = [found.began, *(checkpoint.written for checkpoint in found.checkpoints)]
    silent = time.time() - max([*files, found.tail.written] if found.tail else files)
    sign = f", no sign of life for {silent / 3600:.1f} h: perhaps it is lost" if silent > LOST_AFTER else ""
    return f"whether it is alive can't be told from here{sign}"


def _ending(found: Inventory) -> str:
    """Why a run ended that has a checkpoint."""
    if found.holder is not None:
        return f"killed or lost: {found.holder}"
    if found.rows_from(found.valid.curve_bytes):
        return "ended by an error after its last checkpoint: see its output"
    return f"stopped by {found.why_stopped or 'a signal or a limit of time'}"


def _describe(status: Status, found: Inventory) -> None:
    """What needs no guess."""
    valid, holder, record = found.valid, found.holder if found.in_use else None, found.record or {}
    links = valid.head["links"] if valid else record.get("links", [])
    status.title = _title_of(found)
    status.links, status.ranks = len(links) or None, links[-1]["ranks"] if links else record.get("ranks")
    status.wall_s = sum(link["wall_s"] for link in links) if links else None
    status.steps, status.preload_N = record.get("steps"), record.get("preload_N")
    if holder is not None:
        status.holder, status.ranks = asdict(holder), holder.ranks
        # The present process is one that the checkpoint does not know, until it has written its first.
        status.links = len(links) + (valid is None or valid.written < found.began)
    if valid is not None:
        state = valid.state
        status.steps, status.time_s, status.force_N = valid.steps, state["time"], state["force"]
        status.displacement_m = _place(state)
        status.checkpoint = {
            "file": valid.path.name, "age_s": max(0.0, time.time() - valid.written), "bytes": valid.bytes,
            "steps": valid.steps, "time_s": state["time"],
        }  # fmt: skip
        if valid is not found.checkpoints[0]:
            broken = found.checkpoints[0]
            status.warnings.append(f"{broken.path}: {broken.problem}; the one before it, {valid.path.name}, is valid")


def _title_of(found: Inventory) -> str | None:
    try:
        return tomllib.loads(_scene_text(found)).get("title")
    except (OSError, ValueError):
        return None


def _scene_text(found: Inventory) -> str:
    path = found.folder / storage.SCENE_FILE
    return found.valid.head["scene"] if found.valid else path.read_text(encoding="utf-8")


def _look_ahead(status: Status, found: Inventory) -> None:
    """Where the run is, how fast, and what is left."""
    try:
        scene = parse_scene(_scene_text(found), require_files=False)
    except FileNotFoundError:
        status.left_remark = "it has only just begun"
        return
    except (OSError, ValueError, SceneError) as error:
        status.left_remark = f"its scene can't be read here: {error}"
        return
    status.preload_N = scene.drive.preload
    valid, tail, names = found.valid, found.tail, [phase.name for phase in drive_of(scene).phases]
    if tail is not None and status.state == RESUMABLE:
        tail = CurveTail(tail.path, valid.curve_bytes)
    row = _row_of(valid, tail, names)
    if row is None:
        status.left_remark = "no step has been made yet"
        return
    status.phase, status.time_s = row.phase, row.time
    status.force_N, status.displacement_m = row.force, row.displacement
    if status.state == RUNNING:
        _look_at_present(status, found, scene.output.every, row, names)
    else:
        link = valid.head["links"][-1]
        status.steps_per_s = link["steps"] / link["wall_s"] if link["steps"] else None
    ahead = outlook(scene, _moment(status, found, scene, tail, row))
    status.progress, status.left_remark = ahead.progress, ahead.remark
    if ahead.steps is not None and status.steps_per_s:
        status.left_s = ahead.steps / status.steps_per_s
    elif ahead.steps is not None:
        status.left_remark = "its rate is not known yet"


def _look_at_present(status: Status, found: Inventory, every: int, row: CurveRow, names: list[str]) -> None:
    """Steps and pace of a run that is running."""
    valid, tail = found.valid, found.tail
    # Without a checkpoint, the header and the start come before the first step.
    new = found.rows_from(valid.curve_bytes) if valid else max(0, found.rows_from(0) - 2)
    status.steps = (valid.steps if valid else 0) + new * every
    written = max(file.written for file in (tail, valid) if file)
    status.row_age_s = max(0.0, time.time() - written)
    now = Mark(written, status.steps, row.displacement, row.phase)
    status.steps_per_s, status.punch_m_per_s = _pace(_marks(found, names), now)


def _row_of(valid: Checkpoint | None, tail: CurveTail | None, names: list[str]) -> CurveRow | None:
    """The last that is known of a run; its curve may lag behind a checkpoint where `output.every` leaves rows out."""
    row = tail.rows[-1] if tail and tail.rows else None
    if valid is None or (row is not None and row.time > valid.state["time"]):
        return row
    state = valid.state
    return CurveRow(
        state["time"], _place(state), -_place(state), state["force"], 0.0, 0.0, 0.0, 0.0, state["last_step"],
        names[state["phase"]],
    )  # fmt: skip


def _moment(status: Status, found: Inventory, scene: Scene, tail: CurveTail | None, row: CurveRow) -> Moment:
    state, dwelt = found.valid.state if found.valid else None, 0
    met = state is not None and state["phase"] > 0
    # Explicit steps have one length, whatever the phase.
    counts = scene.drive.dwell > 0.0 and not registry.scheme_of(scene).explicit
    if tail is not None and counts and row.phase != "approach":
        dwelt = scene.output.every * count_ends(tail.path, ending=",dwell")
    return Moment(
        row.phase, row.time, row.displacement, row.force, row.step, status.steps,
        stiffness=tail.stiffness if tail else None, dwell_steps=dwelt,
        preload_time=state["preload_time"] if met else None,
        depth=-state.get("preload_place", state["phase_start"]) if met else None,
    )  # fmt: skip


def _place(state: dict) -> float:
    """Where the punch is [m]; checkpoints of before there were springs know the position alone."""
    return state.get("place", state["position"])


@dataclass(frozen=True)
class Mark:
    """Where a run was at a time of the wall clock [s since 1970]. displacement [m], None if not known."""

    wall: float
    steps: int
    displacement: float | None = None
    phase: str = ""


def _marks(found: Inventory, names: list[str]) -> list[Mark]:
    """What is known of the present process, newest first."""
    marks = [_mark(one.written, one, names) for one in found.checkpoints if one.head and one.written >= found.began]
    if marks:
        return [*marks, Mark(found.began, found.valid.head["links"][-1]["first_step"])]
    return [_mark(found.began, found.valid, names) if found.valid else Mark(found.began, 0)]


def _mark(wall: float, one: Checkpoint, names: list[str]) -> Mark:
    return Mark(wall, one.steps, _place(one.state), names[one.state["phase"]])


def _pace(marks: list[Mark], now: Mark) -> tuple[float | None, float | None]:
    """Steps and metres a second, over the shortest time that is long enough; None where that can't be told."""
    long_ago = [mark for mark in marks if now.wall - mark.wall >= LEAST_SPAN and now.steps > mark.steps]
    # A punch that turned round in between has moved further than it seems.
    on_course = [mark for mark in long_ago if mark.displacement is not None and mark.phase == now.phase]
    steps = way = None
    if long_ago:
        since = _since(long_ago, now)
        steps = (now.steps - since.steps) / (now.wall - since.wall)
    if on_course:
        since = _since(on_course, now)
        way = abs(now.displacement - since.displacement) / (now.wall - since.wall)
    return steps, way


def _since(marks: list[Mark], now: Mark) -> Mark:
    return next((mark for mark in marks if now.wall - mark.wall >= GOOD_SPAN), marks[-1])
