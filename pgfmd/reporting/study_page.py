"""The page of a study: its cases side by side, as far as they have come. What a case has no numbers of is said."""

from __future__ import annotations

import base64
import csv
import io
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.analysis.comparison import load_loops, overlay, renamed
from pgfmd.errors import PgfmdError, ResultError
from pgfmd.files import storage
from pgfmd.files.text import read_text
from pgfmd.plots.curves import axis_unit, labelled
from pgfmd.plots.numbers import FOLLOW, NUMBERS, differences, flat, split
from pgfmd.results import Results, load
from pgfmd.results.curve import Loop, Measures, measure
from pgfmd.results.reading import require_folder
from pgfmd.results.status import Status, status_of
from pgfmd.units import handy, in_si

from .charts import SOLID, Chart, force_chart
from .maps import MOST_FRAMES, Source, evenly, slides
from .page import BAD, FAIR, GOOD, Block, Downloads, Page, bytes_of
from .run_page import doubts_of, scale_places, scene_blocks, state_of
from .wording import Entry, entry, grouped, of_scene, seconds

TABLE_FILE = "table.csv"
PICTURES = {"converge.png": "Convergence"}
"""Pictures of the folder that the page can't draw itself."""
MOST_PICTURE = 400_000
"""Bytes of one of them."""
MOST_CURVES = 60
"""Cases whose curves are drawn."""
MOST_ARCHIVE = 800_000
"""Bytes of the archive with the cases' scenes and curves."""
SHOWN = ("pull-off", "separation", "loop", "contact-area")
"""Numbers that the table and the charts show (plots.numbers.NUMBERS)."""
OF_LOOP = "loop"
"""That of them which means nothing where the loop is not closed."""
STATES = {GOOD: 0, FAIR: 1, BAD: 2}


@dataclass
class Case:
    """A case: name, its folder's status and words about it; results, loop and measures as far as they can be read."""

    name: str
    kind: str
    state: str
    status: Status | None = None
    results: Results | None = None
    loop: Loop | None = None
    found: Measures | None = None

    @property
    def record(self) -> dict[str, Any]:
        """`run.json`; empty where there is none that can be read."""
        try:
            return self.results.run if self.results else {}
        except ResultError:
            return {}

    @property
    def scene(self) -> dict[str, Any]:
        """The resolved scene; empty where it can't be read."""
        try:
            return self.results.scene if self.results else {}
        except ResultError:
            return {}


def study_page(directory: Path, measured: Sequence[Path] = (), options: Mapping[str, Any] | None = None) -> Page:
    """The content of a study's page. options: of `compare`, for the measured curves.

    Raises:
        ResultError: if `directory` is no folder of a study; MeasurementError, ResultError: if the measured curves can't be
        read, or brought to the others.
    """
    require_folder(directory)
    told = _table_of(directory)
    with ExitStack() as stack:
        page = Page(directory.resolve().name, "", "")
        cases = [_case(directory / name, told.get(name, ""), stack, page) for name in _names(directory, told)]
        if not cases:
            raise ResultError(f"{directory}: neither a results folder nor the folder of a study: there is no run in it")
        drawn = [case for case in cases if case.loop is not None]
        _add_head(page, cases)
        keys = _keys_of(drawn)
        page.cases = _rows(cases, keys)
        _add_charts(page, drawn, keys, measured, options or {})
        _add_maps(page, drawn)
        _add_rest(page, directory, cases, keys)
    return page


def _table_of(directory: Path) -> dict[str, str]:
    """The cases that the study's own table knows, with their state then; none without a table."""
    path = directory / TABLE_FILE
    if not path.is_file():
        return {}
    try:
        rows = list(csv.DictReader(io.StringIO(read_text(path))))
    except (OSError, ValueError, csv.Error):
        return {}
    return {row["case"]: row.get("state") or "" for row in rows if row.get("case")}


def _names(directory: Path, told: Mapping[str, str]) -> list[str]:
    """The cases: those of the table in its order, then other folders that look like runs."""
    there = [
        path.name for path in sorted(directory.iterdir())
        if path.is_dir() and any((path / name).is_file() for name in (storage.CURVE_FILE, storage.SCENE_FILE))
    ]  # fmt: skip
    # A name that leads elsewhere is none that a study gives.
    known = [name for name in told if name == Path(name).name and name not in (".", "..")]
    return list(dict.fromkeys([*known, *there]))


def _case(folder: Path, told: str, stack: ExitStack, page: Page) -> Case:
    """A case with what can be read of it; doubts go to the page."""
    if not folder.is_dir():
        return Case(folder.name, FAIR if told in ("", "new") else BAD, told or "not begun")
    try:
        status = status_of(folder)
    except PgfmdError as problem:
        return Case(folder.name, BAD, f"damaged: {problem}")
    if not (folder / storage.CURVE_FILE).is_file():
        state, kind = state_of(status)
        return Case(folder.name, kind, told or state, status)
    case = Case(folder.name, FAIR, "", status)
    try:
        case.results = stack.enter_context(load(folder))
        case.state, case.kind = state_of(status, case.results)
        case.loop = Loop.of(case.results)
        case.found = measure(case.loop)
    except PgfmdError as problem:
        case.loop = None
        case.state, case.kind = case.state or "damaged", BAD
        page.doubts.append(f"{folder.name}: has no numbers: {problem}")
    page.doubts += [f"{folder.name}: {text}" for text in (*status.warnings, *_said_of(case))]
    return case


def _said_of(case: Case) -> list[str]:
    if case.results is None:
        return []
    try:
        found = doubts_of(case.record, case.scene, case.results.directory)
    except ResultError as problem:
        found = [str(problem)]
    if case.record.get("error"):
        found.insert(0, f"failed: {case.record['error']}")
    return found


def _add_head(page: Page, cases: Sequence[Case]) -> None:
    titles = dict.fromkeys(str(case.scene["title"]) for case in cases if case.scene.get("title"))
    page.about = "; ".join(titles) if len(titles) <= 3 else f"{len(titles)} scenes"
    whole = sum(case.kind == GOOD for case in cases)
    page.state = f"{whole} of {len(cases)} cases are finished"
    page.kind = GOOD if whole == len(cases) else max((case.kind for case in cases), key=STATES.__getitem__)
    page.doubts[:0] = [f"{case.name}: {case.state}" for case in cases if case.kind != GOOD]


def _keys_of(cases: Sequence[Case]) -> list[str]:
    """The keys in which the scenes differ, those that mostly follow from others left out."""
    if len(cases) < 2:
        return []
    found = differences([flat(case.results) for case in cases if case.results])
    return [key for key in found if key not in FOLLOW] or found


def _rows(cases: Sequence[Case], keys: Sequence[str]) -> list[tuple[str, list[str]]]:
    """The table of the page: a head, a row a case; a column a number in one unit."""
    units = {}
    for name in SHOWN:
        values = [value for case in cases if (value := _value(case, name)) is not None]
        units[name] = axis_unit([np.array(values or [0.0])], NUMBERS[name].unit)
    head = ["case", *keys, *(labelled(NUMBERS[name].name, units[name][1]) for name in SHOWN), "steps", "time", "state"]
    rows = [("head", head)]
    for case in cases:
        places = flat(case.results) if case.results else {}
        cells = [case.name, *(of_scene(places[key]) if key in places else "–" for key in keys)]
        for name in SHOWN:
            value, spread = _value(case, name), _spread(case, name)
            factor = units[name][0]
            shown = entry(
                "", None if value is None else value / factor, "", "", None if spread is None else spread / factor
            )
            cells.append(shown.value)
        steps, wall = case.record.get("steps"), case.record.get("wall_s")
        cells += [grouped(steps) if isinstance(steps, int) else "–", seconds(wall), case.state]
        rows.append((case.kind, cells))
    return rows


def _value(case: Case, name: str) -> float | None:
    """A number of a case; None where there is none, and the work of a loop that is not closed."""
    if case.found is None or (name == OF_LOOP and case.kind != GOOD):
        return None
    return NUMBERS[name].of(case.found)


def _spread(case: Case, name: str) -> float | None:
    """The uncertainty of a number that a case has."""
    known = case.found is not None and _value(case, name) is not None
    return NUMBERS[name].uncertainty(case.found) if case.found and known else None


def _add_charts(
    page: Page, cases: Sequence[Case], keys: Sequence[str], measured: Sequence[Path], options: Mapping[str, Any]
) -> None:  # fmt: skip
    if not cases:
        return
    shown = [cases[number] for number in evenly(len(cases), MOST_CURVES)]
    loops = renamed([case.loop for case in shown if case.loop])
    if measured:
        loops = _with_measured(page, shown, measured, options)
    page.charts.append(force_chart(loops, measured=len(measured)))
    if len(shown) < len(cases):
        page.charts[0].note = f"{len(shown)} of {len(cases)} cases are drawn. {page.charts[0].note}".strip()
    if keys:
        page.charts += [chart for name in SHOWN if (chart := _number_chart(name, cases, keys[0], keys[1:]))]


def _with_measured(
    page: Page, cases: Sequence[Case], measured: Sequence[Path], options: Mapping[str, Any]
) -> list[Loop]:  # fmt: skip
    """The loops with the measured ones, treated as `compare` does."""
    own = ("machine_stiffness", "correct", "offset")
    reading = {key: value for key, value in options.items() if key not in own}
    if reading.get("baseline") is not None:
        reading["baseline"] = in_si(reading["baseline"], "force")
    stiffness, offset = options.get("machine_stiffness", np.inf), options.get("offset", 0.0)
    runs, experiments = load_loops([*(case.results for case in cases if case.results), *measured], **reading)
    try:
        found = overlay(
            runs, experiments, options.get("correct", "none"), in_si(stiffness, "stiffness"), None,
            None if offset == "fit" else in_si(offset, "length"),
        )  # fmt: skip
    except ValueError as problem:
        raise ResultError(f"the curves could not be compared: {problem}") from None
    page.doubts += [text for loop in found.loops for text in loop.remarks]
    page.details.append(
        Block("What was done to the curves",
              [Entry(loop.name, change) for loop, change in zip(found.loops, found.changes, strict=True)])
    )  # fmt: skip
    return found.loops


def _number_chart(name: str, cases: Sequence[Case], key: str, others: Sequence[str]) -> Chart | None:
    """A number of the cases against the first key in which they differ; a line for each combination of the others. None
    where that key has no numbers, or the cases none of these."""
    lines: dict[str, list[tuple[float, float, float]]] = {}
    unit = ""
    for case in cases:
        scene = flat(case.results) if case.results else {}
        place, unit_here = split(scene.get(key))
        value = _value(case, name)
        if place is None or value is None or not np.isfinite(place):
            continue
        unit = unit_here or unit
        label = ", ".join(f"{other.rpartition('.')[2]} {of_scene(scene.get(other, '–'))}" for other in others)
        lines.setdefault(label, []).append((place, value, _spread(case, name) or np.nan))
    points = [point for line in lines.values() for point in line]
    if len({point[0] for point in points}) < 2:
        return None
    across = handy([point[0] for point in points], unit)
    along = axis_unit([np.array([point[1] for point in points])], NUMBERS[name].unit)
    title = f"{NUMBERS[name].name[0].upper()}{NUMBERS[name].name[1:]} against {key}"
    chart = Chart(f"number-{name}", title, labelled(key.rpartition(".")[2], across[1]),
                  labelled(NUMBERS[name].name, along[1]))  # fmt: skip
    for number, (label, line) in enumerate(sorted(lines.items())):
        x, y, spread = np.array(sorted(line)).T
        chart.add(label or NUMBERS[name].name, x / across[0], y / along[0], number % 6, SOLID, spread=spread / along[0])
    return chart


def _add_maps(page: Page, cases: Sequence[Case]) -> None:
    """A snapshot of each case, the one nearest to the preload."""
    sources, loops = [], {}
    for case in cases:
        results, loop = case.results, case.loop
        if results is None or loop is None or not results.has_fields:
            continue
        try:
            times = np.asarray(results.fields["time"][:], float)
        except ResultError as problem:
            page.doubts.append(f"{case.name}: its maps can't be shown: {problem}")
            continue
        if times.size:
            nearest = int(np.argmin(np.abs(times - loop.time[loop.preload_row])))
            sources.append(Source(results, nearest, f"{case.name}, {results.labels[nearest]}"))
            loops[id(results)] = loop
    chosen = [sources[number] for number in evenly(len(sources), MOST_FRAMES)]
    try:
        page.slides = slides(chosen, loops, len(sources))
    except PgfmdError as problem:
        page.doubts.append(f"maps can't be shown: {problem}")
    if page.slides is None:
        page.slides_missing = "There are no snapshots that could be shown."
    else:
        scale_places(page)


def _add_rest(page: Page, directory: Path, cases: Sequence[Case], keys: Sequence[str]) -> None:
    """Cost, versions, what the cases have in common, the command, files."""
    records = [case.record for case in cases if case.record]
    walls = [record["wall_s"] for record in records if isinstance(record.get("wall_s"), (int, float))]
    if walls:
        page.blocks.append(Block("Cost", [
            Entry("time", seconds(sum(walls)), "", f"of {len(walls)} cases"),
            Entry("longest case", seconds(max(walls))),
            Entry("steps", grouped(sum(int(record.get("steps") or 0) for record in records))),
            Entry("pairs of transforms", grouped(sum(int(record.get("transform_pairs") or 0) for record in records))),
            Entry("most memory of a case", bytes_of(max(int(record.get("peak_rss_bytes") or 0) for record in records))),
        ]))  # fmt: skip
    versions: dict[str, set[str]] = {}
    for record in records:
        for name, text in (record.get("versions") or {}).items():
            versions.setdefault(name, set()).add(str(text))
    page.making = [Block("Versions", [Entry(name, ", ".join(sorted(texts))) for name, texts in versions.items()])]
    page.making = page.making if versions else []
    scenes = [case.scene for case in cases if case.scene]
    if scenes:
        blocks = scene_blocks(_common(scenes))
        page.scene = [Block(block.heading, block.entries, "the same in all cases") for block in blocks]
    for name, title in PICTURES.items():
        path = directory / name
        if path.is_file() and path.stat().st_size <= MOST_PICTURE:
            content = path.read_bytes()
            if content.startswith(b"\x89PNG\r\n"):
                page.pictures.append((title, "data:image/png;base64," + base64.b64encode(content).decode()))
    out = f"{directory.resolve().name}-again"
    page.repeat = [
        f'for scene in */{storage.SCENE_FILE}; do pgfmd run "$scene" --out "{out}/$(dirname "$scene")"; done'
    ]
    page.needs = ["the unpacked cases.zip, from below, as the current folder",
                  *(f"pgfmd {text}" for text in sorted(versions.get("pgfmd", ())))]  # fmt: skip
    _add_downloads(page.downloads, page, directory, cases)


def _common(scenes: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The keys, in their tables, that have the same value in all scenes."""
    found: dict[str, Any] = {}
    for key, value in scenes[0].items():
        if isinstance(value, dict):
            tables = [scene.get(key) for scene in scenes]
            if all(isinstance(table, dict) for table in tables):
                inner = _common([table for table in tables if isinstance(table, dict)])
                found |= {key: inner} if inner else {}
        elif all(scene.get(key) == value for scene in scenes):
            found[key] = value
    return found


def _add_downloads(downloads: Downloads, page: Page, directory: Path, cases: Sequence[Case]) -> None:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(cells for _, cells in page.cases)
    downloads.add("cases.csv", text.getvalue().encode(), "text/csv")
    path = directory / TABLE_FILE
    if path.is_file():
        downloads.add(TABLE_FILE, path.read_bytes(), "text/csv")
    small: dict[str, bytes] = {}
    large: dict[str, bytes] = {}
    size = 0
    for case in cases:
        for name, into in ((storage.SCENE_FILE, small), (storage.RUN_FILE, large), (storage.CURVE_FILE, large)):
            path = directory / case.name / name
            if path.is_file():
                size += path.stat().st_size
                if into is small or size <= 4 * MOST_ARCHIVE:
                    into[f"{case.name}/{name}"] = path.read_bytes()
    archive = small | large if size <= 4 * MOST_ARCHIVE else small
    if archive is small and large:
        downloads.notes.append("cases.zip has the scenes alone: with the curves it would be too large for this page")
    if archive:
        downloads.add_zip("cases.zip", archive)
