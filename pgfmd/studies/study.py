"""Studies from Python: many runs, their table, and the limit of a quantity on finer levels. A serial process that
starts others.

table = pgfmd.study(scene, {"drive.speed": ["1 um/s", "10 um/s"]}, out="out/speeds", jobs=2)
table["pull_off_force [N]"]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pgfmd.errors import PgfmdError
from pgfmd.files.regular_files import write_atomically
from pgfmd.host import launch
from pgfmd.host.walltime import seconds_of
from pgfmd.restart.scene_changes import require_known
from pgfmd.scene import Scene
from pgfmd.scene.dotted_keys import field_of
from pgfmd.scene.fields import extra_of, written
from pgfmd.scene.model import SECTIONS
from pgfmd.scene.unresolved_scene import plain
from pgfmd.units import DIMENSIONS, UnitError, handy_quantity, parse_quantity

from .campaign import Campaign, Unfinished, Wishes, make_folder
from .cases import Case, cases_of
from .extrapolation import Extrapolation, extrapolate
from .pictures import draw_study
from .refinement import Levels, levels_of
from .study_file import Axis, StudyError, read_study, study_from_mapping
from .table import FILE, StudyTable, rows_of

OFF = "off"
SCENE_FILE = "scene.toml"
"""File for the scene of a study that was made from a scene in memory, in the folder of the study."""
Keys = Mapping[str, Any]
Axes = Mapping[str, Sequence[Any] | Mapping[str, Keys]]


@dataclass(frozen=True)
class Plan:
    """A study with its cases and their folder. axes, ranks, jobs: of the study; title: of pictures."""

    campaign: Campaign
    axes: tuple[Axis, ...]
    title: str
    ranks: int = 1
    jobs: int = 1

    def table(self) -> StudyTable:
        """The table of the results so far. Raises ResultError if the folder can't be made."""
        campaign = self.campaign
        make_folder(campaign.out)
        rows = rows_of(campaign.cases, self.axes, campaign.states(), campaign.out)
        return StudyTable(rows, self.axes, campaign.out, self.title)

    def run(self, only: Sequence[str] = ()) -> tuple[StudyTable, Unfinished | None]:
        """Runs unfinished cases. Returns the table of all cases, and the error to raise if some are still not finished.
        only: names of the cases to run, with * as a wildcard."""
        problem = None
        try:
            self.campaign.only(only).run(self.ranks, self.jobs)
        except Unfinished as error:
            problem = error
        return self.table(), problem


def write(table: StudyTable) -> list[Path]:
    """Writes `table.csv` and the pictures of a study into its folder; returns them. ResultError if one can't be."""
    path = table.out / FILE
    table.to_csv(path)
    return [path, *draw_study(table)]


def study(
    source: str | Path | Keys | Scene,
    axes: Axes | None = None,
    *,
    cases: Mapping[str, Keys] | None = None,
    out: str | Path | None = None,
    ranks: int | None = None,
    jobs: int | None = None,
    only: Sequence[str] = (),
    retry: bool = False,
    fresh: bool = False,
    allow: Sequence[str] = (),
    checkpoint_every: str | None = None,
    twins: bool = False,
    run: bool = True,
    say: Callable[[str], None] = print,
) -> StudyTable:
    """Runs many scenes, or continues them, and returns their table, as `pgfmd study` does.

    Args:
        source: the file of a study, or the same as nested tables; with `axes` or `cases`, a scene or what one is made from.
        axes: values by key, such as "drive.speed", as SI numbers or texts with units; or by the name of an axis,
            bundles of keys by name. The study has all combinations.
        cases: further cases, by name: the keys that each changes.
        out: the folder for the cases' folders, `table.csv` and pictures. For a file the default is out/NAME.
        ranks: of each job; jobs: in parallel. None for the numbers in the file, or one.
        only: names of the cases to run, with * as a wildcard. The table has all cases.
        retry: also run failed cases. fresh: start changed and damaged cases again. allow: keys that may have changed.
        checkpoint_every: time between checkpoints, such as "10min", or "off".
        twins: run the quasi-static twins of the cases too, one for all that share it; the table then has the share of
            multistability in the hysteresis.
        run: False starts nothing and returns the table of existing results.
        say: called with lines of progress.

    Raises:
        StudyError, SceneError: for an invalid study or scene; Unfinished, if cases could not be finished: its `table`
            is the table; ResultError: if the folder can't be used.
    """
    options = {"retry": retry, "fresh": fresh, "allow": allow, "say": say}
    plan = planned(source, axes, cases, out, ranks, jobs, checkpoint_every, twins, **options)
    if not run:
        return plan.table()
    table, problem = plan.run(only)
    write(table)
    if problem is not None:
        problem.table = table
        raise problem
    return table


def planned(
    source: str | Path | Keys | Scene,
    axes: Axes | None = None,
    cases: Mapping[str, Keys] | None = None,
    out: str | Path | None = None,
    ranks: int | None = None,
    jobs: int | None = None,
    checkpoint_every: str | None = None,
    twins: bool = False,
    **options: Any,
) -> Plan:
    """A study before it is run. The arguments are as in `study`. Raises StudyError, SceneError."""
    launch_alone()
    if axes is None and cases is None and not isinstance(source, Scene):
        if isinstance(source, Mapping):
            found = study_from_mapping(plain(source), "study", Path.cwd())
        else:
            found = read_study(source)
            out = out or Path("out", found.name)
    else:
        mapping = {
            "axes": _axes(axes or {}),
            "case": [{"name": name, "set": _keys(keys)} for name, keys in (cases or {}).items()],
        }
        found = study_from_mapping({"scene": _scene_file(source, out), **mapping}, "study", Path.cwd())
    if out is None:
        raise ValueError("study: out names the folder that the cases go to; only a study in a file has one of its own")
    found = replace(found, ranks=ranks or found.ranks, checkpoint_every=checkpoint_every or found.checkpoint_every)
    listed = cases_of(found)
    if twins or found.twins:
        from .twins import with_twins

        listed = with_twins(listed)
    campaign = campaign_of(listed, Path(out), found.checkpoint_every, **options)
    return Plan(campaign, found.axes, found.title or found.name, found.ranks, jobs or found.jobs)


def campaign_of(
    cases: list[Case], out: Path, every: str, retry: bool = False, fresh: bool = False, allow: Sequence[str] = (),
    say: Callable[[str], None] = print,
) -> Campaign:  # fmt: skip
    """The cases with their options. Raises SceneError for a key that may not change, StudyError for a text that is not
    a time."""
    require_known(allow)
    try:
        _ = every == OFF or seconds_of(every)
    except ValueError as error:
        raise StudyError("run", [f"checkpoint_every = {every!r}: {error}"]) from None
    return Campaign(cases, out, Wishes(retry, fresh, tuple(allow), every), say)


def launch_alone() -> None:
    """Raises PgfmdError if mpirun has started this process, because a study starts mpirun itself."""
    processes, _ = launch.launched()
    if processes > 1:
        raise PgfmdError("start it without mpirun: it starts one for each of its jobs (--ranks)")


def _scene_file(source: str | Path | Keys | Scene, out: str | Path | None) -> str:
    """The scene of a study as its cases name it: a name, a file, or one in the study's folder that is written."""
    if isinstance(source, (str, Path)):
        return str(source)
    if out is None:
        raise ValueError("study: out names the folder that the cases go to")
    make_folder(Path(out))
    scene, path = source if isinstance(source, Scene) else Scene(source), Path(out) / SCENE_FILE
    write_atomically(path, scene.given.to_toml().encode())
    return str(path.absolute())


def _axes(axes: Axes) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, values in axes.items():
        if isinstance(values, Mapping):
            found[name] = {label: _keys(keys) for label, keys in values.items()}
        else:
            found[name] = [_value(name, value) for value in values]
    return found


def _keys(keys: Keys) -> dict[str, Any]:
    """Keys with their values as in a file; sections may be nested tables."""
    found: dict[str, Any] = {}
    for name, value in keys.items():
        if isinstance(value, Mapping):
            found |= (
                {f"{name}.{key}": each for key, each in _keys(value).items()} if name in SECTIONS else {name: value}
            )
        else:
            found[name] = _value(name, value)
    return {name: _value(name, value) for name, value in found.items()}


def _value(key: str, value: Any) -> Any:
    """A Python value as in a file: the SI number of a quantity becomes a text with a suitable unit."""
    field = field_of(key)
    extra = extra_of(field) if field else {}
    value = plain(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or extra.get("dimension") not in DIMENSIONS:
        return value
    text = handy_quantity(float(value), extra["dimension"], 6)
    try:
        same = parse_quantity(text, extra["dimension"]) == value
    except UnitError:
        same = False
    return text if same else written(float(value), extra)


def converge(
    scene: str | Path | Scene,
    *,
    axis: str = "rho",
    levels: int = 4,
    quantity: str = "loop",
    power: float | None = None,
    start: float | None = None,
    factor: float | None = None,
    largest_n: int | None = None,
    out: str | Path | None = None,
    ranks: int = 1,
    retry: bool = False,
    fresh: bool = False,
    allow: Sequence[str] = (),
    checkpoint_every: str = "10min",
    say: Callable[[str], None] = print,
) -> Extrapolation:
    """Runs a scene on finer levels, fits a power law, and extrapolates, as `pgfmd converge` does.

    Args:
        scene: a scene, a file, or a shipped name.
        axis: what is refined: "rho", "n" or "accuracy"; levels: their number; start: n, or the accuracy, of the
            coarsest level; factor: from level to level; largest_n: limit of the grid.
        quantity: what is extrapolated: "loop", "work" or "pull-off"; power: of its error, if it is known.
        out: the folder of the levels' folders; out/converge-NAME-AXIS for a file or a shipped name.
        others: as of `study`.

    Raises:
        SceneError: for an invalid scene; Unfinished, if levels could not be finished; ResultError: if fewer than two
            are finished.
    """
    if out is None:
        if isinstance(scene, Scene):
            raise ValueError("converge: out names the folder that the levels go to")
        out = Path("out", f"converge-{Path(scene).stem}-{axis}")
    out = Path(out)
    source = _scene_file(scene, out)
    ladder, plan = refined(
        source, (), axis, levels, None if start is None else f"{start!r}", factor, largest_n, ranks, out, checkpoint_every,
        retry=retry, fresh=fresh, allow=allow, say=say,
    )  # fmt: skip
    table, problem = plan.run()
    write(table)
    if problem is not None:
        problem.table = table
        raise problem
    return extrapolate(ladder, table.rows, quantity, power)


def refined(
    source: str, overrides: Sequence[str], axis: str, levels: int, start: str | None, factor: float | None,
    largest_n: int | None, ranks: int, out: Path, every: str, **options: Any,
) -> tuple[Levels, Plan]:  # fmt: skip
    """The levels of a refinement, and the study that runs them. The arguments are as in `converge`. Raises
    SceneError."""
    launch_alone()
    ladder = levels_of(source, overrides, axis, levels, start, factor, largest_n, ranks)
    campaign = campaign_of(ladder.cases, out, every, **options)
    title = f"{ladder.cases[0].scene.title or source}: refined in {axis}"
    return ladder, Plan(campaign, (ladder.key,), title, ranks, 1)
