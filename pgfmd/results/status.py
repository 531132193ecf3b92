"""The state of the run in a results folder: running, finished, resumable, ..., and what is left. No MPI, no fields.

Only heads of checkpoints and the end of the curve are read, so that a hundred folders of large runs take seconds. Ages
and rates are from modification times of files, which have one clock; clocks of nodes may differ.
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
from pgfmd.restart.resume import OF_EARLIER
from pgfmd.scene import Scene, parse_scene
from pgfmd.scene_objects import drive_of
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
    """The state of a run. Unknown or inapplicable values are None.

    why: how it finished, why it ended, or what is wrong. time_s [s], steps, displacement_m [m], force_N [N], phase: the
    present ones of a running run, else those from which it would continue. row_age_s [s]: age of the last row of the
    curve. checkpoint: the newest valid one. wall_s [s]: of all links, up to the checkpoint. steps_per_s, punch_m_per_s
    [m/s]: per second of wall time. progress: completed fraction of the punch's travel. left_s [s]: estimated remaining
    wall time (progress.py); left_remark: what it does not include, or why it is unknown.
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
        """The status as plain data for JSON."""
        plain: dict[str, Any] = storage.plain(asdict(self))
        return plain


def status_of(folder: str | Path) -> Status:
    """The status of a results folder. Raises ResultError if it is not one, or can't be read."""
    found = take_inventory(Path(folder))
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
    """State and reason."""
    valid, finished = found.valid, found.finished
    over = valid.state["finished"] if valid else ""
    if over and finished and not (found.holder and found.holder.alive):
        # Even if the lock still exists, because the record is written last.
        return FINISHED, over
    if found.in_use:
        return RUNNING, "" if found.holder and found.holder.alive else _doubt(found)
    if valid is not None:
        ending = f"{over}, only its record is missing" if over else _ending(found, valid)
        return RESUMABLE, f"failed: {found.failure}" if found.failure else ending
    if found.checkpoints:
        wrong = "; ".join(f"{one.path.name}: {one.problem}" for one in found.checkpoints)
        return DAMAGED, f"{f'finished ({finished}), but ' if finished else ''}no checkpoint is valid: {wrong}"
    if finished:
        # The user may delete the checkpoints of a finished run.
        return FINISHED, finished
    failed = f"; failed: {found.failure}" if found.failure else ""
    if found.rows_from(0) > 2:
        return DAMAGED, f"results, but no checkpoint to go on from{failed}"
    return EMPTY, f"ended before its first step{failed}"


def _doubt(found: Inventory) -> str:
    """Information about a run on another host."""
    files = [found.began, *(checkpoint.written for checkpoint in found.checkpoints)]
    silent = time.time() - max([*files, found.tail.written] if found.tail else files)
    sign = f", no sign of life for {silent / 3600:.1f} h: perhaps it is lost" if silent > LOST_AFTER else ""
    return f"whether it is alive can't be told from here{sign}"


def _ending(found: Inventory, valid: Checkpoint) -> str:
    """Why a run with a checkpoint ended."""
    if found.holder is not None:
        return f"killed or lost: {found.holder}"
    if found.rows_from(valid.curve_bytes):
        return "ended by an error after its last checkpoint: see its output"
    return f"stopped by {found.why_stopped or 'a signal or a limit of time'}"


def _describe(status: Status, found: Inventory) -> None:
    """Sets everything that needs no estimate."""
    valid, holder, record = found.valid, found.holder if found.in_use else None, found.record or {}
    links = valid.head["links"] if valid else record.get("links", [])
    status.title = _title_of(found)
    status.links, status.ranks = len(links) or None, links[-1]["ranks"] if links else record.get("ranks")
    status.wall_s = sum(link["wall_s"] for link in links) if links else None
    status.steps, status.preload_N = record.get("steps"), record.get("preload_N")
    if holder is not None:
        status.holder, status.ranks = asdict(holder), holder.ranks
        # The checkpoint does not contain the present process until it has written its first one.
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
    return str(found.valid.head["scene"]) if found.valid else path.read_text(encoding="utf-8")


def _look_ahead(status: Status, found: Inventory) -> None:
    """Sets present state, speed and remaining time."""
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
    if tail is not None and valid is not None and status.state == RESUMABLE:
        tail = CurveTail(tail.path, valid.curve_bytes)
    row = _row_of(valid, tail, names)
    if row is None:
        status.left_remark = "no step has been made yet"
        return
    status.phase, status.time_s = row.phase, row.time
    status.force_N, status.displacement_m = row.force, row.displacement
    if status.state == RUNNING:
        _look_at_present(status, found, scene.output.every, row, names)
    elif valid is not None:
        link = valid.head["links"][-1]
        status.steps_per_s = link["steps"] / link["wall_s"] if link["steps"] else None
    ahead = outlook(scene, _moment(status, found, scene, tail, row))
    status.progress, status.left_remark = ahead.progress, ahead.remark
    if ahead.steps is not None and status.steps_per_s:
        status.left_s = ahead.steps / status.steps_per_s
    elif ahead.steps is not None:
        status.left_remark = "its rate is not known yet"


def _look_at_present(status: Status, found: Inventory, every: int, row: CurveRow, names: list[str]) -> None:
    """Sets steps and speed of a running run."""
    valid, tail = found.valid, found.tail
    # Without a checkpoint, the header and the start come before the first step.
    new = found.rows_from(valid.curve_bytes) if valid else max(0, found.rows_from(0) - 2)
    status.steps = (valid.steps if valid else 0) + new * every
    written = max(file.written for file in (tail, valid) if file)
    status.row_age_s = max(0.0, time.time() - written)
    now = Mark(written, status.steps, row.displacement, row.phase)
    status.steps_per_s, status.punch_m_per_s = _pace(_marks(found, names), now)


def _row_of(valid: Checkpoint | None, tail: CurveTail | None, names: list[str]) -> CurveRow | None:
    """The last known state of a run; its curve may be older than the checkpoint if `output.every` leaves out rows."""
    row = tail.rows[-1] if tail and tail.rows else None
    if valid is None or (row is not None and row.time > valid.state["time"]):
        return row
    state = valid.state
    return CurveRow(
        state["time"], _place(state), -_place(state), state["force"], 0.0, 0.0, 0.0, 0.0, state["last_step"],
        names[state["phase"]],
    )  # fmt: skip


def _moment(status: Status, found: Inventory, scene: Scene, tail: CurveTail | None, row: CurveRow) -> Moment:
    state: dict[str, Any] = found.valid.state if found.valid else {}
    dwelt, met = 0, state.get("phase", 0) > 0
    # Explicit steps have the same length in all phases.
    counts = scene.drive.dwell > 0.0 and not registry.scheme_of(scene).explicit
    if tail is not None and counts and row.phase != "approach":
        dwelt = scene.output.every * count_ends(tail.path, ending=",dwell")
    return Moment(
        row.phase, row.time, row.displacement, row.force, row.step, status.steps or 0,
        stiffness=tail.stiffness if tail else None, dwell_steps=dwelt,
        preload_time=state["preload_time"] if met else None,
        depth=-state.get("preload_place", state["phase_start"]) if met else None,
    )  # fmt: skip


def _place(state: dict) -> float:
    """Displacement of the punch [m]; old checkpoints only have the position of the drive."""
    return state.get("place", state["position"])


@dataclass(frozen=True)
class Mark:
    """State of a run at a wall-clock time [s since 1970]. displacement [m], None if unknown."""

    wall: float
    steps: int
    displacement: float | None = None
    phase: str = ""


def _marks(found: Inventory, names: list[str]) -> list[Mark]:
    """Known states of the present process, newest first."""
    marks = [_mark(one.written, one, names) for one in found.checkpoints if one.head and one.written >= found.began]
    if marks and found.valid:
        return [*marks, Mark(found.began, found.valid.head["links"][-1]["first_step"])]
    return [_mark(found.began, found.valid, names) if found.valid else Mark(found.began, 0)]


def _mark(wall: float, one: Checkpoint, names: list[str]) -> Mark:
    return Mark(wall, one.steps, _place(one.state), names[one.state["phase"]])


def _pace(marks: list[Mark], now: Mark) -> tuple[float | None, float | None]:
    """Steps and metres per second, averaged over the shortest sufficient time; None if unknown."""
    long_ago = [mark for mark in marks if now.wall - mark.wall >= LEAST_SPAN and now.steps > mark.steps]
    # If the punch turned in between, it has moved further than the difference.
    on_course = [mark for mark in long_ago if mark.displacement is not None and mark.phase == now.phase]
    steps = speed = None
    if long_ago:
        since = _since(long_ago, now)
        steps = (now.steps - since.steps) / (now.wall - since.wall)
    since = _since(on_course, now) if on_course else now
    if since.displacement is not None and now.displacement is not None and since is not now:
        speed = abs(now.displacement - since.displacement) / (now.wall - since.wall)
    return steps, speed


def _since(marks: list[Mark], now: Mark) -> Mark:
    return next((mark for mark in marks if now.wall - mark.wall >= GOOD_SPAN), marks[-1])
