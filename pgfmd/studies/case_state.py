"""The state of a case of a study: the state of its folder, and whether the folder has the case's scene. No MPI."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pgfmd.errors import ResultError, SceneError
from pgfmd.files import storage
from pgfmd.physics.drive import ENDED_WELL

from .cases import Case

NEW, FINISHED, RESUMABLE, RUNNING = "new", "finished", "resumable", "running"
FAILED, CHANGED, DAMAGED = "failed", "changed", "damaged"


@dataclass(frozen=True)
class CaseState:
    """State, and a reason if there is one. record: `run.json`, None if there is none."""

    state: str
    why: str = ""
    record: dict | None = None

    @property
    def complete(self) -> bool:
        """Whether the whole programme was run."""
        return self.state == FINISHED and self.why in ENDED_WELL

    def __str__(self) -> str:
        return self.state if not self.why or self.complete else f"{self.state} ({self.why})"


def case_state_of(case: Case, folder: Path, allow: Sequence[str] = ()) -> CaseState:
    """The state of a case whose results are in `folder`; allow: keys that may differ from what the run began with.

    `failed`: the run ended with an error. `changed`: the folder has a run of another scene. `damaged`: no run can be
    continued there. Each has a message.
    """
    from pgfmd.results.status import DAMAGED as BROKEN
    from pgfmd.results.status import EMPTY, status_of

    if not folder.exists():
        return CaseState(NEW)
    try:
        status = status_of(folder)
    except ResultError as error:
        return CaseState(DAMAGED, str(error))
    if status.state == EMPTY:
        return CaseState(NEW)
    if status.state == BROKEN:
        return CaseState(DAMAGED, status.why)
    if status.state == RUNNING:
        return CaseState(RUNNING, status.why)
    if status.state == FINISHED:
        # Its numbers belong to its own settings, so only keys of the output may differ.
        allow = [key for key in allow if key.partition(".")[0] == "output"]
    changes = _changes(case, folder, allow)
    if changes:
        return CaseState(CHANGED, changes)
    record = _record(folder)
    if record and record.get("finished") == FAILED:
        return CaseState(FAILED, record.get("error", ""), record)
    return CaseState(status.state, status.why, record)


def _record(folder: Path) -> dict | None:
    try:
        found = json.loads((folder / storage.RUN_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _changes(case: Case, folder: Path, allow: Sequence[str]) -> str:
    """Why the run in a folder does not belong to this case; empty if it does. The run itself checks the same."""
    from pgfmd.restart.scene_changes import contents_of, review
    from pgfmd.results.inventory import take_inventory

    try:
        found = take_inventory(folder)
        head = found.valid.head if found and found.valid else None
        if head is None:
            text = (folder / storage.SCENE_FILE).read_text(encoding="utf-8")
            if text == case.scene.to_toml():
                return ""
            head = {"scene": text, "files": contents_of(case.scene)}
        review(head, case.scene, allow, folder)
    except SceneError as error:
        return str(error)
    except KeyError:
        # For a finished run without checkpoints nothing may change.
        return f"{folder} holds a run of another scene: choose another --out, or start anew with --fresh"
    except (OSError, ResultError) as error:
        return str(error)
    return ""
