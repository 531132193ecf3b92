"""The page of a run: what its folder holds, as far as it can be read. What can't be is said on the page."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from pgfmd.analysis.comparison import Comparison, compare
from pgfmd.analysis.summary import Analysis, analyse
from pgfmd.analysis.table import Row
from pgfmd.errors import PgfmdError, ResultError
from pgfmd.files import storage
from pgfmd.files.table_reading import count_ends
from pgfmd.files.tables import CURVE, ENERGY, EVENTS, PATCHES, SITES
from pgfmd.physics.drive import DETACHED
from pgfmd.results import Results, load
from pgfmd.results.caption import SEPARATOR, about
from pgfmd.results.curve import Loop, Measures
from pgfmd.results.doubts import missed_preload, unbalanced, uncertain_loop
from pgfmd.results.status import DAMAGED, FINISHED, RUNNING, Status, status_of
from pgfmd.scene.unresolved_scene import PATHS
from pgfmd.units import UnitError, parse_quantity

from .charts import area_chart, energy_chart, force_chart, time_charts
from .maps import frames_of, slides
from .page import BAD, FAIR, GOOD, Block, Page, bytes_of
from .wording import Entry, entry, grouped, of_scene, seconds

Value = TypeVar("Value")
MOST_READ = 2_000_000
"""Bytes of a table that a page may hold whole."""
THINNED_ROWS = 5000
"""Rows of a longer one that it holds."""
TABLES = (CURVE, ENERGY, EVENTS, SITES, PATCHES)
SIDE_BY_SIDE = ("Displacements",)
"""Sections of a comparison that say what was done to the curves."""


def run_page(
    directory: Path, twin: Path | None = None, measured: Sequence[Path] = (), options: Mapping[str, Any] | None = None
) -> Page:
    """The content of a run's page. options: of `compare`, for the measured curves.

    Raises:
        ResultError: if `directory` or `twin` is no results folder; MeasurementError, ResultError: if the measured curves
        can't be read, or compared.
    """
    with ExitStack() as stack:
        results = stack.enter_context(load(directory))
        if twin is not None:
            stack.enter_context(load(twin))
        status = status_of(directory)
        page = Page(_title(results), _about(results), *state_of(status, results))
        page.doubts += status.warnings
        analysis = _told(page, "the numbers", lambda: analyse(directory, twin))
        compared = None
        if analysis is not None and (measured or twin is not None):
            sources = [directory, *([twin] if twin else []), *measured]
            compared = compare(*sources, **(options or {}))
        if analysis is not None:
            _add_numbers(page, analysis, compared, status.state == FINISHED and status.why == DETACHED)
            _add_charts(page, results, analysis, compared, len(measured))
        _add_maps(page, results, analysis.loop if analysis else None)
        _add_doubts(page, results, analysis)
        _add_facts(page, results, status)
        add_downloads(page, directory)
    return page


def _title(results: Results) -> str:
    return str(_attempt(lambda: results.scene.get("title")) or results.directory.resolve().name)


def _about(results: Results) -> str:
    """Folder, speed, grid and date."""
    text = _attempt(lambda: about(results)) or ""
    return SEPARATOR.join([results.directory.resolve().name, *text.split(SEPARATOR)[1:]])


def _attempt(action: Callable[[], Value]) -> Value | None:
    try:
        return action()
    except (ResultError, UnitError, KeyError, TypeError, ValueError):
        return None


def _told(page: Page, what: str, action: Callable[[], Value]) -> Value | None:
    """What `action` finds; None, with a word among the doubts, where a part of the folder can't be read."""
    try:
        return action()
    except PgfmdError as problem:
        page.doubts.append(f"{what} can't be shown: {problem}")
    return None


def state_of(status: Status, results: Results | None = None) -> tuple[str, str]:
    """The state of a run in words, and whether that is GOOD, FAIR or BAD."""
    record = (_attempt(lambda: results.run) or {}) if results else {}
    if status.state == FINISHED:
        whole = status.why == DETACHED
        return (f"finished: {status.why}", GOOD) if whole else (f"ended early: {status.why}", FAIR)
    if status.state == RUNNING:
        share = "" if status.progress is None else f", about {100 * status.progress:.0f} % of the way"
        return f"running{share}: the page shows what there was when it was made", FAIR
    kind = BAD if status.state == DAMAGED or "error" in record or status.why.startswith("failed") else FAIR
    if status.state == DAMAGED and record.get("finished") == DETACHED:
        return f"finished: {DETACHED}, but its checkpoints are damaged", FAIR
    return f"{status.state}: {status.why}" if status.why else status.state, kind


def _add_numbers(page: Page, analysis: Analysis, compared: Comparison | None, closed: bool) -> None:
    page.cards = cards_of(analysis.measures, closed)
    sections = {**analysis.table.sections}
    audit = sections.pop("Hysteresis by the energy audit", None)
    if audit:
        page.blocks.append(Block("Energy audit", entries_of(audit), "the net work of the punch, and where it went"))
    against = sections.pop("Hysteresis against the quasi-static twin", None)
    if against:
        name = analysis.twin.name if analysis.twin else ""
        # A page is mailed: where folders are on this machine is nobody's business.
        rows = [dataclasses.replace(row, note=Path(name).name) if row.note == name else row for row in against]
        page.blocks.append(Block("Against the quasi-static twin", entries_of(rows)))
    page.details += [Block(title, entries_of(rows)) for title, rows in sections.items()]
    if compared is not None:
        for title, rows in compared.table.sections.items():
            heading = "What was done to the curves" if title in SIDE_BY_SIDE else title
            page.details.append(Block(heading, entries_of(rows)))


def cards_of(found: Measures, closed: bool = True) -> list[Entry]:
    """The numbers that are looked at first, each with its uncertainty where one is known. closed: whether the punch has
    come off again."""
    pull_off, snap_in = found.pull_off, found.snap_in
    cards = [
        entry("pull-off force", pull_off.tension if pull_off else None, "N", "largest tension on the way out",
              pull_off.uncertainty if pull_off else None),
        entry("work of separation", found.work_of_separation, "J", "against a tensile force on the way out",
              found.work_of_separation_uncertainty),
        entry("hysteresis", found.hysteresis, "J", "net work of the loop", found.hysteresis_uncertainty) if closed
        else entry("net work so far", found.hysteresis, "J", "the loop is not closed"),
        entry("snap-in force", snap_in.tension, "N", "largest tension on the way in", snap_in.uncertainty)
        if closed or found.preload is not None else entry("snap-in force", None, "N", "the approach is not over"),
        entry("preload", found.preload, "N", "force at the end of the approach"),
    ]  # fmt: skip
    for kind, areas in list(found.areas.items())[:1]:
        cards.append(entry(f"{kind} area", areas.at_preload, "m^2", "at the preload"))
    if found.time_to_preload is not None:
        cards.append(entry("time to the preload", found.time_to_preload, "s", "from the first contact"))
    return cards


def entries_of(rows: Sequence[Row]) -> list[Entry]:
    """Rows of a table as a page shows them."""
    found = []
    for row in rows:
        # The table has the uncertainty in its note as well, which goes with the number here.
        note = row.note.split(", ", 1)[1] if row.note.startswith("± ") and ", " in row.note else row.note
        note = "" if note.startswith("± ") else note
        found.append(entry(row.name, row.value, row.unit, note, row.uncertainty))
    return found


def _add_charts(
    page: Page, results: Results, analysis: Analysis, compared: Comparison | None, measured: int
) -> None:  # fmt: skip
    loop = analysis.loop
    if compared is None:
        page.charts.append(force_chart([loop], analysis.measures))
    else:
        page.charts.append(force_chart(compared.loops, measured=measured))
        changes = {name for name in compared.changes if name not in ("as simulated", "as measured")}
        page.charts[0].note = "; ".join([*sorted(changes), page.charts[0].note]).strip("; ")
        page.doubts += compared.table.remarks
        page.doubts += [text for loop in compared.loops[-measured:] if measured for text in _elsewhere(loop, compared)]
    page.charts += time_charts([loop])
    if loop.areas:
        page.charts.append(area_chart(loop))
    energy = _told(page, "the energy audit", lambda: energy_chart(results))
    page.charts += [energy] if energy else []


def _elsewhere(measured: Loop, compared: Comparison) -> list[str]:
    """What is said of a measured curve that has no indentation in common with the first run."""
    run = compared.loops[0].indentation
    if measured.indentation.max() >= run.min() and measured.indentation.min() <= run.max():
        return []
    return [f"{measured.name} has no indentation in common with {compared.loops[0].name}: --offset fit brings it there"]


def _add_maps(page: Page, results: Results, loop: Loop | None) -> None:
    if not results.has_fields:
        page.slides_missing = "The run has written no snapshots."
        return

    def draw() -> None:
        sources = frames_of(results)
        page.slides = slides(sources, {id(results): loop} if loop else {}, len(results.labels))
        if page.slides is None:
            page.slides_missing = "The run has written no snapshots yet."

    _told(page, "the maps", draw)
    if page.slides is None and not page.slides_missing:
        page.slides_missing = "The snapshots could not be read."
    if page.slides and page.charts and loop:
        scale_places(page)


def scale_places(page: Page) -> None:
    """Brings the places of the slider's mark, in SI units, to those of the chart of forces."""
    assert page.slides is not None
    for key, unit in zip(("indentation", "force"), page.charts[0].units, strict=True):
        for frame in page.slides.data["frames"]:
            if key in frame:
                frame[key] = float(f"{frame[key] / unit:.6g}")


def _add_doubts(page: Page, results: Results, analysis: Analysis | None) -> None:
    record = _told(page, "run.json", lambda: results.run) or {}
    if record.get("error"):
        page.doubts.insert(0, f"the run failed: {record['error']}")
    scene = _told(page, "the scene", lambda: results.scene) or {}
    page.doubts += doubts_of(record, scene, results.directory)
    if analysis is not None:
        # What an audit leaves unexplained, and a loop that is uncertain, are said above already, by what the run itself says.
        page.doubts += [
            text for text in analysis.table.remarks if not text.startswith(("the energy audit leaves", "the loop of"))
        ]
    page.doubts += _foreseen(results)
    page.doubts[:] = dict.fromkeys(page.doubts)


def doubts_of(record: dict[str, Any], scene: dict[str, Any], directory: Path) -> list[str]:
    """What is to be said of a run's preload and audit. record, scene: of its folder."""
    found = []
    preload = scene.get("drive", {}).get("preload")
    if preload is not None:
        asked = _attempt(lambda: parse_quantity(preload, "force"))
        found += missed_preload(record, asked) if asked else []
    return found + unbalanced(record, directory) + uncertain_loop(record)


def _foreseen(results: Results) -> list[str]:
    """The warnings that `pgfmd check` has for the scene; none for a scene that can't be read here."""
    from pgfmd.forecast.advice import warnings
    from pgfmd.scene import load_scene

    ranks = int((_attempt(lambda: results.run) or {}).get("ranks") or 1)
    try:
        scene = load_scene(results.directory / storage.SCENE_FILE)
        return [f"about the scene: {text}" for text in warnings(scene, ranks)]
    except (PgfmdError, OSError, ValueError):
        # Of an earlier version, or its height map is elsewhere: what it was warned of is not known.
        return ["whether there are warnings about the scene is not known: it can't be read by this version, or here"]


def _add_facts(page: Page, results: Results, status: Status) -> None:
    record, scene = _attempt(lambda: results.run) or {}, _attempt(lambda: results.scene) or {}
    page.scene = scene_blocks(scene)
    cost = cost_of(record, status)
    if cost:
        page.blocks.append(Block("Cost", cost))
    versions = record.get("versions") or {}
    if versions:
        page.making.append(Block("Versions", [Entry(name, str(text)) for name, text in versions.items()]))
    links = record.get("links") or []
    if links:
        rows = [
            Entry(str(link.get("started", "")), f"{grouped(int(link.get('steps') or 0))} steps",
                  "", f"on {link.get('host', '?')}, ranks: {link.get('ranks', '?')}, {seconds(link.get('wall_s'))}")
            for link in links
        ]  # fmt: skip
        page.making.append(Block("Processes of the run", rows))
    ranks = int(record.get("ranks") or status.ranks or 1)
    name = results.directory.resolve().name
    run = f"pgfmd run {storage.SCENE_FILE} --out {shlex.quote(f'{name}-again')}"
    page.repeat = [run if ranks == 1 else f"mpirun -n {ranks} {run}"]
    page.needs = needs_of(scene, versions)


def needs_of(scene: dict[str, Any], versions: dict[str, Any]) -> list[str]:
    """What the command of a page needs besides the scene."""
    needs = [f"{storage.SCENE_FILE}, from below, in the current folder"]
    if versions.get("pgfmd"):
        needs.append(f"pgfmd {versions['pgfmd']}")
    for key in PATHS:
        section, _, name = key.partition(".")
        path = scene.get(section, {}).get(name)
        if isinstance(path, str) and path:
            needs.append(f"the file that {key} names, {Path(path).name}")
    return needs


def scene_blocks(scene: dict[str, Any]) -> list[Block]:
    """The keys of a resolved scene by section, in handy units."""
    blocks: list[Block] = []

    def add(title: str, table: dict[str, Any]) -> None:
        rows = [Entry(key, of_scene(value)) for key, value in table.items() if not isinstance(value, dict)]
        if rows and title:
            blocks.append(Block(f"[{title}]", rows))
        for key, value in table.items():
            if isinstance(value, dict):
                add(f"{title}.{key}" if title else key, value)

    add("", scene)
    return blocks


def cost_of(record: dict[str, Any], status: Status) -> list[Entry]:
    """What a run cost, as far as it is known."""
    found = []
    wall = record.get("wall_s") or status.wall_s
    if wall is not None:
        found.append(Entry("time", seconds(wall), "", "of all its processes"))
    for key, name in (("transform_s", "of it in transforms"), ("checkpoint_s", "of it for checkpoints")):
        if record.get(key) is not None:
            found.append(Entry(name, seconds(record[key])))
    if status.left_s is not None and status.state == RUNNING:
        found.append(Entry("about left", seconds(status.left_s), "", status.left_remark))
    for key, name in (
        ("ranks", "ranks"), ("n", "points a side, n"), ("steps", "steps"), ("rejected_steps", "rejected steps"),
        ("newton_iterations", "Newton iterations"), ("cg_iterations", "iterations of conjugate gradients"),
        ("transform_pairs", "pairs of transforms"), ("jumps", "jumps"),
    ):  # fmt: skip
        value = record.get(key)
        value = getattr(status, key, None) if value is None else value
        if isinstance(value, int):
            found.append(Entry(name, grouped(value)))
    if record.get("precision"):
        found.append(Entry("precision", str(record["precision"])))
    if record.get("peak_rss_bytes"):
        found.append(Entry("memory", bytes_of(record["peak_rss_bytes"]), "", "of all ranks, at most"))
    return found


def add_downloads(page: Page, directory: Path) -> None:
    """The scene, the record and the tables of a run; of long tables the rows that a curve shows."""
    kinds = {".csv": "text/csv", ".json": "application/json"}
    for name in (storage.SCENE_FILE, storage.RUN_FILE, *(table.file for table in TABLES)):
        path = directory / name
        try:
            if not path.is_file():
                continue
            if path.stat().st_size <= MOST_READ:
                page.downloads.add(name, path.read_bytes(), kinds.get(path.suffix, "text/plain"))
            elif name in (CURVE.file, ENERGY.file):
                thin, rows = thinned_table(path)
                page.downloads.add(f"{path.stem}.thinned.csv", thin, "text/csv")
                page.downloads.notes.append(f"{name} has {grouped(rows)} rows: some of them, evenly chosen, are here")
            else:
                page.downloads.left_out.append(f"{name} ({bytes_of(path.stat().st_size)})")
        except OSError as problem:
            page.doubts.append(f"{name} could not be read: {storage.reason(problem)}")


def thinned_table(path: Path) -> tuple[bytes, int]:
    """The head of a long table, with THINNED_ROWS of its rows, evenly chosen, and how many rows it has."""
    rows = count_ends(path) - 1
    step = -(-rows // THINNED_ROWS)
    with open(path, "rb") as file:
        head = file.readline()
        lines = [line for number, line in enumerate(islice(file, rows)) if number % step == 0 or number == rows - 1]
    return b"".join([head, *lines]), rows
