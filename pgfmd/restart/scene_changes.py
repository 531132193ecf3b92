"""Whether a run may continue with a scene that differs from the one it began with. No MPI.

The scene has to describe all results. So only output, future phases of the programme, and the accuracy of time steps
may change, and only if the user allows it.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pgfmd.errors import Problem, SceneError
from pgfmd.physics.adhesion.registry import length_of
from pgfmd.physics.drive import PRELOAD, Drive, Phase, automatic_turn
from pgfmd.scene import parse_scene
from pgfmd.scene.model import SECTIONS
from pgfmd.scene.unresolved_scene import PATHS, Given
from pgfmd.scene_objects import drive_of

if TYPE_CHECKING:
    from pgfmd.scene import Scene

UNIMPORTANT = ("title", "output.directory", "rheology.reference")
"""Keys without effect on a run. Weights of a resolved scene always refer to the relaxed modulus, with or without the key."""
PRECISION = "solver.precision"
"""The key that a scene may leave open ("auto"). A continued run then keeps the precision that it began with."""
PEAKS = "punch.file_peaks"
CHANGEABLE = ("output.every", "output.snapshots", "solver.accuracy", "solver.max_steps")
"""Keys that may change at any time. Keys of [drive] may change before their phase begins."""
DERIVED = ("adhesion.q_ref", "adhesion.range", "drive.clearance", "drive.turn_time")
"""Keys that are usually automatic."""
NOT_THERE = "not there"
STEPS = "drive.step"


def contents_of(scene: Scene) -> dict[str, str]:
    """SHA-256 of each file that the scene names, by key. Raises OSError if one can't be read."""
    named = {dotted: getattr(scene.section(dotted.split(".")[0]), dotted.split(".")[1]) for dotted in PATHS}
    named |= {_file_of(number): step.file for number, step in enumerate(scene.drive.step, 1)}
    return {key: _digest_of(path) for key, path in named.items() if path}


def _file_of(number: int) -> str:
    """The key of the file that a step, counted from 1, follows."""
    return f"{STEPS}.{number}.file"


def _digest_of(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def require_known(allow: Sequence[str]) -> None:
    """Raises SceneError for keys that can't be allowed to change, or do not exist."""
    known = [*CHANGEABLE, *(f"drive.{name}" for name in SECTIONS["drive"].model_fields), "drive", "output", "solver"]
    problems = [Problem("--allow", key, ", ".join(known)) for key in allow if key not in known]
    if problems:
        raise SceneError("command line", problems)


def review(head: dict, scene: Scene, allow: Sequence[str], folder: Path) -> list[str]:
    """The keys that have changed since a checkpoint with this head was written.

    allow: keys or sections that may change. Raises SceneError with all keys that must not have changed.
    """
    changed, problems = [], []
    for key, before, now in differing(head["scene"], scene, head["files"]):
        refusal = _refusal(key, head, scene, allow)
        if refusal is not None:
            problems.append(Problem(key, now, repr(before), refusal))
        else:
            changed.append(key)
    if problems:
        anew = "choose another --out, or start anew with --fresh"
        raise SceneError(f"{folder} holds a run of another scene: {anew}", problems)
    return changed


def differing(text: str, scene: Scene, known: dict[str, str] | None = None) -> Iterator[tuple[str, object, object]]:
    """Key, old value and new value for all differences between a scene and the one in `text`, which is TOML.

    known: SHA-256 of the files of the old scene; without it, files are compared by name. A precision that the scene
    leaves open is not a difference. Raises ValueError if the text is not TOML.
    """
    old, new = _flat(_rewritten(text)), _flat(scene.to_toml())
    files = contents_of(scene) if known is not None else {}
    # Keys that follow from others come last.
    for key in sorted(old.keys() | new.keys(), key=lambda key: (key in DERIVED, key)):
        before, now = old.get(key, NOT_THERE), new.get(key, NOT_THERE)
        if known is not None and key in PATHS:
            # Files are compared by contents, not by path.
            if files.get(key) == known.get(key):
                continue
            now = f"{now} with other contents" if before == now else now
        elif known is not None and key == STEPS and _without_paths(before) == _without_paths(now):
            if _same_files(files, known):
                continue
            now = f"{now} with other contents of a file"
        elif before == now or key in UNIMPORTANT or (key == PRECISION and scene.solver.automatic_precision):
            continue
        elif (key, before, now) == (PEAKS, NOT_THERE, "down"):
            # What was taken for granted before there was such a key.
            continue
        yield key, before, now


def _same_files(files: dict[str, str], known: dict[str, str]) -> bool:
    """Whether the files that steps follow have the contents of before."""
    of_steps = ({key: digest for key, digest in each.items() if key.startswith(STEPS)} for each in (files, known))
    return next(of_steps) == next(of_steps)


def _without_paths(steps: object) -> object:
    """Steps without the names of the files that they follow."""
    if not isinstance(steps, list):
        return steps
    return [step | {"file": ""} if isinstance(step, dict) and "file" in step else step for step in steps]


def precision_kept(text: str, scene: Scene) -> str | None:
    """The precision of a continued run, from the text of its scene; None if the new scene names one."""
    return str(_flat(text).get(PRECISION, "double")) if scene.solver.automatic_precision else None


def _refusal(key: str, head: dict, scene: Scene, allow: Sequence[str]) -> str | None:
    """Why a key must not change, or how to allow it; None if it may."""
    section = key.partition(".")[0]
    if key in ("drive.control", "drive.machine_stiffness"):
        return "the punch hangs on the old spring"
    if section == "drive":
        why = _drive_refusal(head, scene)
        if why:
            return why
    elif key not in CHANGEABLE:
        return ""
    # Such as drive.repeat of drive.repeat.times.
    table = ".".join(key.split(".")[:2])
    if {key, table, section} & set(allow) or (_turn_follows(key, scene) and "drive.retract_speed" in allow):
        return None
    return f"to go on with the new one, add --allow {table}"


def _turn_follows(key: str, scene: Scene) -> bool:
    """Whether a key is the turn time, and has the automatic value for the speeds."""
    speeds = scene.drive.speed, scene.drive.retract_speed
    return key == "drive.turn_time" and scene.drive.turn_time == automatic_turn(length_of(scene.adhesion), *speeds)


def _drive_refusal(head: dict, scene: Scene) -> str:
    """Why the programme of the scene can't be used; empty if only future phases have changed."""
    if "state" not in head:
        return "the run is over"
    text, changed = _with_present_files(head, scene)
    before = parse_scene(text, source="the scene of the checkpoint", require_files=False)
    old, new, state = drive_of(before), drive_of(scene), head["state"]
    now = state["phase"]
    if bool(old.programme) != bool(new.programme):
        return "the run has a programme of the other kind, with steps or without"
    if stages := changed & {phase.stage for phase in old.phases[: now + 1]}:
        return f"step {min(stages)} has begun, and the file that it follows has other contents now"
    if scene.drive.controls_load and not before.drive.controls_load and before.solver.precision != "double":
        return 'a held load needs solver.precision = "double", which the run did not begin with'
    if old.clearance != new.clearance or _begun(old, now) != _begun(new, now):
        begun = f"the {old.phases[now].name} has begun"
        kept = replace(new, turn_time=old.turn_time)
        if kept.clearance == old.clearance and _begun(kept, now) == _begun(old, now):
            return f'{begun}: keep drive.turn_time = "{old.turn_time!r} s"'
        return begun
    if old.preload == new.preload or new.programme:
        return ""
    if old.phases[now].ends_with != PRELOAD:
        return "the preload has been met"
    return "" if new.preload > state["force"] else f"the force is {state['force']:.6g} N already"


def _with_present_files(head: dict, scene: Scene) -> tuple[str, set[int]]:
    """The scene of a checkpoint, with the files that the steps of a scene now follow in the place of its own, which may have
    moved; and the numbers of the steps whose files have other contents now."""
    tables, files = tomllib.loads(head["scene"]), contents_of(scene)
    steps = tables.get("drive", {}).get("step", [])
    changed: set[int] = set()
    for number, (old, new) in enumerate(zip(steps, scene.drive.step, strict=False), 1):
        if "file" in old and new.file:
            old["file"] = new.file
            if files[_file_of(number)] != head["files"].get(_file_of(number)):
                changed.add(number)
    title = str(tables.pop("title", ""))
    return (Given.of(tables | {"title": title}).to_toml() if steps else head["scene"]), changed


def _begun(drive: Drive, now: int) -> list[Phase]:
    """The phases of a programme that have begun, up to the one of number `now`; the present one of the short form without
    the preload, which may change as long as it is ahead."""
    phases = [replace(phase, final=False) for phase in drive.phases[: now + 1]]
    if not drive.programme:
        phases[-1] = replace(phases[-1], endings=())
    return phases


def _rewritten(text: str) -> str:
    """A resolved scene of any version as this version would write it; unchanged if it can't be read any more.

    Its files may have moved.
    """
    try:
        return parse_scene(text, require_files=False).to_toml()
    except SceneError:
        return text


def _flat(text: str) -> dict[str, object]:
    """A scene's TOML as one table with dotted keys."""
    flat, stack = {}, [("", tomllib.loads(text))]
    while stack:
        prefix, table = stack.pop()
        for name, value in table.items():
            if isinstance(value, dict):
                stack.append((f"{prefix}{name}.", value))
            else:
                flat[prefix + name] = value
    return flat
