"""Studies from Python: many runs, their table, and what a quantity tends to on finer levels. Serial: starts processes.

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
"""In the folder of a study: the scene of one that was made from a scene in memory."""
Keys = Mapping[str, Any]
Axes = Mapping[str, Sequence[Any] | Mapping[str, Keys]]


@dataclass(frozen=True)
class Plan:
    """A study with its cases and the folder that they go to. axes, ranks, jobs: of the study; title: of pictures."""

    campaign: Campaign
    axes: tuple[Axis, ...]
    title: str
    ranks: int = 1
    jobs: int = 1

    def table(self) -> StudyTable:
        """The table of what there is so far. Raises ResultError if the folder can't be made."""
        campaign = self.campaign
        make_folder(campaign.out)
        rows = rows_of(campaign.cases, self.axes, campaign.states(), campaign.out)
        return StudyTable(rows, self.axes, campaign.out, self.title)

    def run(self, only: Sequence[str] = ()) -> tuple[StudyTable, Unfinished | None]:
        """Runs what is not finished; returns the table of all cases, and what there is to be raised where some are not
        finished. only: names of the cases that are run, * stands for anything."""
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
    """Runs many scenes, or goes on with them, and returns their table; as `pgfmd study`.

    Args:
        source: the file of a study, or the same as nested tables; with `axes` or `cases`, a scene or what one is made from.
        axes: by key, such as "drive.speed", the values that all combinations are made of: SI numbers, or texts with
            units; or by the name of an axis, bundles of keys by name.
        cases: further cases, by name: the keys that each changes.
        out: the folder of the cases' folders, and of `table.csv` and pictures. May be left out for a file: out/NAME.
        ranks: of each job; jobs: side by side. None for what the file says, or one.
        only: names of the cases that are run, * stands for anything; the table has all.
        retry, fresh, allow: go on with failed cases; begin changed and damaged ones anew; keys that may have changed.
        checkpoint_every: time between checkpoints, such as "10min", or "off".
        twins: run the quasi-static twins of the cases too, one for all that share it; the table then has the share of
            multistability in the hysteresis.
        run: False starts nothing: the table of what there is.
        say: called with lines of progress.

    Raises:
        StudyError, SceneError: for a study, or a scene, that can't be; Unfinished, where cases could not be finished: its
        `table` is the table; ResultError: if the folder can't be used.
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
    """A study as it is going to be run. Arguments as of `study`. Raises StudyError, SceneError."""
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
    """The cases with what is asked of them. Raises SceneError for a key that can't be allowed to change, StudyError for a
    text that is no time."""
    require_known(allow)
    try:
        _ = every == OFF or seconds_of(every)
    except ValueError as error:
        raise StudyError("run", [f"checkpoint_every = {every!r}: {error}"]) from None
    return Campaign(cases, out, Wishes(retry, fresh, tuple(allow), every), say)


def launch_alone() -> None:
    """Raises PgfmdError where mpirun has started this process: it starts its jobs with it."""
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
    """Keys with their values as a file has them; sections may be tables of their own."""
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
    """A value of Python as a file has it: a number of a quantity, which is in SI units, as a text with a handy one."""
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
    """Runs a scene on finer and finer levels, fits a power law, and extrapolates; as `pgfmd converge`.

    Args:
        scene: a scene, a file, or a shipped name.
        axis: what is refined: "rho", "n" or "accuracy"; levels: how many; start: n, or the accuracy, of the coarsest;
            factor: from level to level; largest_n: no finer grid.
        quantity: what is extrapolated: "loop", "work" or "pull-off"; power: of its error, where it is known.
        out: the folder of the levels' folders; out/converge-NAME-AXIS for a file or a shipped name.
        others: as of `study`.

    Raises:
        SceneError: for a scene that can't be; Unfinished, where levels could not be finished; ResultError: where fewer
        than two are.
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
    """The levels of a refinement, and what is going to be run. Arguments as of `converge`. Raises SceneError."""
    launch_alone()
    ladder = levels_of(source, overrides, axis, levels, start, factor, largest_n, ranks)
    campaign = campaign_of(ladder.cases, out, every, **options)
    title = f"{ladder.cases[0].scene.title or source}: refined in {axis}"
    return ladder, Plan(campaign, (ladder.key,), title, ranks, 1)
