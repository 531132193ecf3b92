"""The quasi-static twin of a run: the same test infinitely slowly, whose loop is lost to instabilities alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pgfmd.errors import ResultError
from pgfmd.files.storage import SCENE_FILE
from pgfmd.scene import load_scene
from pgfmd.scene.quasistatic_twin import CHANGES
from pgfmd.schemes import registry

SUFFIX = "-twin"
"""What the folder of a twin is called, behind the name of its run."""


def run_twin(directory: str | Path, out: Path | None = None, say: Callable[[str], None] = print) -> Path:
    """Runs the quasi-static twin of the run in a folder, or goes on with it; returns its folder.

    It is in `out`, or beside the folder of the run, and is called like it with "-twin" behind. What it is expected to cost
    is said first. Raises ResultError if the run is quasi-static itself, SceneError if its scene can't be read.
    """
    directory = Path(directory)
    scene = load_scene(directory / SCENE_FILE)
    if registry.scheme_of(scene).timeless:
        raise ResultError(f"{directory}: the run is quasi-static itself, and needs no twin")
    twin = load_scene(directory / SCENE_FILE, CHANGES)
    name = directory.resolve().name + SUFFIX
    folder = out / name if out else directory.resolve().with_name(name)
    # Not at the top: what is analysed as it is needs no solver.
    from pgfmd.forecast.effort import effort_of
    from pgfmd.start import run

    effort = effort_of(twin)
    say(
        f"quasi-static twin into {folder}: about {effort.steps:.2g} steps, {effort.pairs:.2g} transform pairs, "
        f"{effort.seconds:.2g} s (within a factor of {effort.spread:.2g})"
    )
    run(twin, folder, say=say).close()
    return folder
