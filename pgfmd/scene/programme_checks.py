"""The rules of a scene about its loading programme (see checks.py)."""

from __future__ import annotations

import os
from collections.abc import Iterator

from pgfmd.errors import MeasurementError, Problem
from pgfmd.files.followed_path import read_path
from pgfmd.physics.drive import FORCE
from pgfmd.schemes import registry

from .drive_section import REPLACED
from .fields import expectation, extra_of
from .model import SECTIONS
from .output_section import Output
from .partial_scene import MISSING, PartialScene, example
from .programme_section import largest_force


def programme_is_said_once(draft: PartialScene) -> Iterator[Problem]:
    """Either speed, preload and what else belongs to them, or steps."""
    if not draft.given("drive.step"):
        for name in ("speed", "preload"):
            if not draft.given(f"drive.{name}"):
                expected = expectation(extra_of(SECTIONS["drive"].model_fields[name]))
                yield Problem(f"drive.{name}", MISSING, expected, f"add {example('drive', name)} to [drive]")
        if draft.given("drive.repeat"):
            yield draft.problem("drive.repeat", "steps to be repeated", "add them as [[drive.step]], or delete it")
        return
    for name in sorted(REPLACED):
        if draft.given(f"drive.{name}"):
            yield draft.problem(f"drive.{name}", "no such key beside drive.step", "delete it, or the steps")
    steps = draft["drive.step"]
    if not steps:
        yield draft.problem("drive.step", "at least one step", "add one, such as an approach")
    elif largest_force(steps) and draft.given("drive.preload"):
        yield draft.problem("drive.preload", "no such key where steps name forces", "delete it")
    elif not largest_force(steps) and not draft.given("drive.preload"):
        expected = "about the largest force of the programme, as no step names one: errors are relative to it"
        yield Problem("drive.preload", MISSING, expected, f"add {example('drive', 'preload')} to [drive]")


def repeats_are_of_steps(draft: PartialScene) -> Iterator[Problem]:
    """Numbers of repeated steps that there are, in their order."""
    repeat, count = draft["drive.repeat"], len(draft["drive.step"])
    if repeat is None or not count:
        return
    last = repeat.last or count
    if not repeat.first <= last <= count:
        expected = f"first and last steps in their order, of the {count} that there are"
        yield draft.problem("drive.repeat", expected, f"it has first = {repeat.first} and last = {last}")


def programme_can_be_done(draft: PartialScene) -> Iterator[Problem]:
    """Steps whose order makes sense from where the punch is."""
    steps = draft["drive.step"]
    if not steps:
        return
    if steps[0].do in ("hold", "retract", "oscillate") and draft["drive.clearance"] == "auto":
        cure = "begin with an approach, or set drive.clearance to start in contact"
        yield draft.problem("drive.step", f"something else than '{steps[0].do}' for a punch out of reach", cure)
    for number, step in enumerate(steps, 1):
        pulls = step.rate is not None and step.rate < 0.0
        wrong = step.rate == 0.0 or (step.do == "approach" and "free" in step.until)
        wrong = wrong or (step.do == "ramp" and not pulls and "free" in step.until)
        if wrong:
            why = "a rate that is not 0" if step.rate == 0.0 else "no end at 'free' for a punch that is pressed in"
            yield Problem(f"drive.step.{number}", step.do, why, "correct it, or delete the step")
    if registry.named(draft["solver.scheme"]).timeless and all(step.do == "hold" for step in steps):
        yield draft.problem("drive.step", "a step that moves, as nothing is held without time", "add one")


def followed_files_can_be_read(draft: PartialScene) -> Iterator[Problem]:
    """Files that steps follow; relative ones start at the scene's folder."""
    for number, step in enumerate(draft["drive.step"], 1):
        if step.file is None:
            continue
        path = draft.folder / os.path.expanduser(step.file)
        try:
            read_path(path, step.of)
        except (MeasurementError, OSError, ValueError) as error:
            # ValueError: a path that can be none, with a character of code 0.
            yield Problem(f"drive.step.{number}.file", step.file, "a file to follow", str(error))


def snapshots_ahead_can_be_placed(draft: PartialScene) -> Iterator[Problem]:
    """Snapshots before the preload, whose times are found by a run of the first step alone."""
    steps, texts = draft["drive.step"], draft["output.snapshots"]
    if not steps or (steps[0].do in ("approach", "ramp") and FORCE in [named for named, _ in steps[0].endings]):
        return
    output = Output.model_construct(snapshots=texts)
    if any(relative and value < 1.0 for value, relative in output.snapshot_times):
        expected = "no fractions of t_pl below 1, as the first step does not end with a force"
        yield draft.problem("output.snapshots", expected, 'write "every 0.1 um" or "every 1 mN" instead')


PROGRAMME_RULES = (
    programme_is_said_once,
    repeats_are_of_steps,
    programme_can_be_done,
    snapshots_ahead_can_be_placed,
)
