"""numbers.csv, and what is written from it into docs/evidence/paper.md, between `<!-- figure NAME -->` and `<!-- end -->`."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Iterable
from pathlib import Path

from ..pages import FIGURES, page_named
from ..validation.drawing import number
from . import HERE
from .drawing import CONTACT, OVERLAP, Claim, Drawing

PAGE = page_named("paper.md")
FOLDER = FIGURES / "paper"
OLD_COUNT = HERE / "old_count.csv"
"""What the runs of earlier versions gave, which counted gaps below zero: size, figure, what, settings, ours."""
COLUMNS = ("size", "figure", "what", "settings", "unit", "paper", "low", "high", "ours", "count", "before")
SHOWN = {"reduced": "reduced", "paper": "paper's size"}
"""Sizes that the page shows, and the heads of their columns."""
NEVER, STALE = "never", "not counted again"

Row = dict[str, str]


def rows_of(size: str, figure: str, claims: Iterable[Claim]) -> list[Row]:
    """Rows of numbers.csv: numbers of eight digits, none where the paper says nothing."""
    rows = []
    for claim in claims:
        low, high, ours = (_text(x) for x in (claim.low, claim.high, claim.ours))
        before = "" if claim.before is None else _text(claim.before) or NEVER
        told = (claim.what, claim.settings, claim.unit, claim.told)
        rows.append(dict(zip(COLUMNS, (size, figure, *told, low, high, ours, claim.count, before), strict=True)))
    return rows


def _text(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.8g}"


def read_rows(folder: Path) -> list[Row]:
    """The rows of numbers.csv in this folder, none if there is no such file."""
    return _read(folder / "numbers.csv")


def _read(path: Path) -> list[Row]:
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def keep(
    folder: Path,
    size: str,
    figure: str,
    drawing: Drawing | None,
    figures: Iterable[str],
    missing: str = "",
    runs: Iterable[str] = (),
) -> None:
    """Puts the rows and the caption of a figure at a size in place of older ones. drawing: None if it can't be drawn.
    figures: all names, in order; missing: about the runs that are not there; runs: those that it was drawn from."""
    order, key = list(figures), f"{figure}-{size}"
    rows = [row for row in read_rows(folder) if (row["size"], row["figure"]) != (size, figure)]
    _write_rows(folder, rows + rows_of(size, figure, drawing.claims if drawing else ()), order)
    captions = read_captions(folder)
    captions.pop(key, None)
    _note(captions, key, missing)
    if drawing:
        captions[key] = drawing.caption
    else:
        (folder / f"{key}.png").unlink(missing_ok=True)
    _write_json(folder / "captions.json", captions)
    known = read_runs(folder)
    known.pop(key, None)
    if drawing:
        known[key] = sorted(runs)
    _write_json(folder / "runs.json", known)


def recount(
    folder: Path, size: str, figure: str, drawing: Drawing | None, figures: Iterable[str], missing: str = ""
) -> None:
    """Of a figure whose picture and numbers stay, since some of their runs are not there: puts what the others say
    about contact in place of what was said with another count. Arguments as of `keep`."""
    claims = drawing.claims if drawing else ()
    fresh = {_key(row): row for row in rows_of(size, figure, claims) if row["count"] == CONTACT}
    rows = []
    for row in read_rows(folder):
        mine = (row["size"], row["figure"]) == (size, figure)
        rows.append(fresh.pop(_key(row), row) if mine else row)
    _write_rows(folder, rows + list(fresh.values()), list(figures))
    captions = read_captions(folder)
    _note(captions, f"{figure}-{size}", missing)
    _write_json(folder / "captions.json", captions)


def _note(captions: dict[str, str], key: str, missing: str) -> None:
    captions.pop(f"{key}-missing", None)
    if missing:
        captions[f"{key}-missing"] = missing


def _key(row: Row) -> tuple[str, str]:
    return row["what"], row["settings"]


def _write_rows(folder: Path, rows: list[Row], order: list[str]) -> None:
    rows = [row for row in rows if row["figure"] in order]
    # Stable: within a figure the order is that of its claims.
    rows.sort(key=lambda row: (order.index(row["figure"]), row["size"]))
    with (folder / "numbers.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _write_json(path: Path, content: dict) -> None:
    path.write_text(json.dumps(dict(sorted(content.items())), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _read_json(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def read_captions(folder: Path) -> dict[str, str]:
    """Captions by "figure-size", and by "figure-size-missing" about the runs that it lacks."""
    return _read_json(folder / "captions.json")


def read_runs(folder: Path) -> dict[str, list[str]]:
    """By "figure-size", the runs (study/case) that its picture and numbers were made from."""
    return _read_json(folder / "runs.json")


def verdict(row: Row, ours: str = "ours") -> str:
    """How our number stands to what the paper's words admit; empty where it gives no number. ours: its column."""
    if not row["low"]:
        return ""
    if not row[ours]:
        return "not reached"
    low, high, value = (float(row[name]) for name in ("low", "high", ours))
    if low * (1 - 1e-9) <= value <= high * (1 + 1e-9) or math.isclose(value, low, abs_tol=1e-12):
        return "agrees"
    bound, word = (low, "below") if value < low else (high, "above")
    if bound <= 0.0 or abs(value / bound) > 10:
        return word
    # Two digits, but never an exponent.
    return f"{float(f'{100 * abs(value / bound - 1):.2g}'):g}\N{NO-BREAK SPACE}% {word}"


def table(rows: list[Row]) -> str:
    """Rows of one figure, all sizes, as a table of the page. The verdict is on the largest size that there is, of those
    in which contact is counted as it is now."""
    sizes = [size for size in SHOWN if any(row["size"] == size for row in rows)]
    lines = _head("what", "settings", "paper", *(SHOWN[size] for size in sizes), "verdict")
    for found in _by_key(rows).values():
        best = _best(found)
        any_row = best or next(iter(found.values()))
        cells = [*_told(any_row)]
        for size in sizes:
            row = found.get(size)
            cells.append("" if row is None else STALE if row["count"] == OVERLAP else _shown(row["ours"]))
        lines.append(_line(*cells, verdict(best) if best else ""))
    return "\n".join(lines)


def _head(*heads: str) -> list[str]:
    return [_line(*heads), _line(*["---"] * len(heads))]


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _told(row: Row) -> tuple[str, str, str]:
    """What a row is about, its settings, and the paper's words."""
    unit = f" [{row['unit']}]" if row["unit"] else ""
    told = row["paper"].replace("-", "\N{MINUS SIGN}") if row["paper"][:1] in "-0123456789" else row["paper"]
    return f"{row['what']}{unit}", row["settings"], told


def _shown(value: str) -> str:
    return number(float(value), 4) if value else NEVER


def _by_key(rows: list[Row]) -> dict[tuple[str, str], dict[str, Row]]:
    """Rows of one figure by what they are about, then by size."""
    found: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        found.setdefault(_key(row), {})[row["size"]] = row
    return found


def _best(found: dict[str, Row]) -> Row | None:
    """The row of the largest size in which contact, if it matters, is counted as it is now."""
    rows = [found[size] for size in SHOWN if size in found and found[size]["count"] != OVERLAP]
    return rows[-1] if rows else None


def picture_of(figure: str, size: str) -> str:
    """Where a picture is, as a link of the page has it."""
    return Path(os.path.relpath(FOLDER / f"{figure}-{size}.png", PAGE.parent)).as_posix()


def block(figure: str, folder: Path) -> str:
    """What the page shows of a figure: its pictures, the larger size first, with captions, and its table."""
    captions, parts, shown = read_captions(folder), [], set()
    for size in reversed(SHOWN):
        path = folder / f"{figure}-{size}.png"
        # A figure that needs no run is the same at all sizes.
        if path.exists() and (picture := path.read_bytes()) not in shown:
            shown.add(picture)
            caption = captions.get(f"{figure}-{size}", "")
            parts.append(f"![{figure}, {SHOWN[size]}]({picture_of(figure, size)})\n\n*{caption}*")
    rows = [row for row in read_rows(folder) if row["figure"] == figure and row["size"] in SHOWN]
    if rows:
        parts.append(table(rows))
    for size, word in SHOWN.items():
        command = f"python -m scripts.studies.paper.run {figure} --size {size}"
        if told := captions.get(f"{figure}-{size}-missing"):
            parts.append(f"Not run here ({word}): {told}. `{command}` runs them.")
        if stale := sum(row["size"] == size and row["count"] == OVERLAP for row in rows):
            parts.append(
                f"Not counted again ({word}): {stale} of the numbers; their runs were made when contact was a "
                f"negative gap. `{command}` makes them again, unless there are results of version 0.1."
            )
    return "\n\n".join(parts)


def counts_block(folder: Path, figures: Iterable[str]) -> str:
    """The table of all numbers that depend on what counts as contact: with gaps below zero, and as it is now."""
    heads = ("figure", "what", "settings", "size", "paper", "gap < 0", "verdict then", "contact", "verdict now")
    old = {(row["size"], row["figure"], *_key(row)): row["ours"] for row in _read(OLD_COUNT)}
    lines, rows = _head(*heads), read_rows(folder)
    for figure in figures:
        for found in _by_key([row for row in rows if row["figure"] == figure and row["size"] in SHOWN]).values():
            best = _best(found)
            if best is None or best["count"] != CONTACT:
                continue
            place = (best["size"], figure, *_key(best))
            # The same run with the other count comes first; an empty number of an old one is a "never", too.
            before = {"before": (best["before"] or old.get(place, "")).removesuffix(NEVER)}
            known = bool(best["before"]) or place in old
            if not known and not best["low"]:
                # Nothing to compare: neither an earlier number nor one of the paper.
                continue
            what, settings, told = _told(best)
            then = (_shown(before["before"]), verdict(best | before, "before")) if known else ("", "")
            lines.append(_line(figure, what, settings, best["size"], told, *then, _shown(best["ours"]), verdict(best)))
    return "\n".join(lines)
