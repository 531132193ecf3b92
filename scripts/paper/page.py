"""numbers.csv, and what is written from it into docs/paper.md, between `<!-- figure NAME -->` and `<!-- end -->`."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable
from pathlib import Path

from validation.drawing import number

from paper import ROOT
from paper.drawing import Claim, Drawing

PAGE = ROOT / "docs" / "paper.md"
FOLDER = ROOT / "docs" / "figures" / "paper"
COLUMNS = ("size", "figure", "what", "settings", "unit", "paper", "low", "high", "ours")
SHOWN = {"reduced": "reduced", "paper": "paper's size"}
"""Sizes that the page shows, and the heads of their columns."""


def rows_of(size: str, figure: str, claims: Iterable[Claim]) -> list[dict[str, str]]:
    """Rows of numbers.csv: numbers of eight digits, none where the paper says nothing."""
    rows = []
    for claim in claims:
        low, high, ours = ("" if math.isnan(x) else f"{x:.8g}" for x in (claim.low, claim.high, claim.ours))
        values = (size, figure, claim.what, claim.settings, claim.unit, claim.told, low, high, ours)
        rows.append(dict(zip(COLUMNS, values, strict=True)))
    return rows


def read_rows(folder: Path) -> list[dict[str, str]]:
    """The rows of numbers.csv in this folder, none if there is no such file."""
    path = folder / "numbers.csv"
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def keep(
    folder: Path, size: str, figure: str, drawing: Drawing | None, figures: Iterable[str], missing: str = ""
) -> None:
    """Puts the rows and the caption of a figure at a size in place of older ones. drawing: None if it can't be drawn.
    figures: all names, in order; missing: about the runs that are not there."""
    order = list(figures)
    old = [row for row in read_rows(folder) if row["figure"] in order]
    rows = [row for row in old if (row["size"], row["figure"]) != (size, figure)]
    rows += rows_of(size, figure, drawing.claims if drawing else ())
    # Stable: within a figure the order is that of its claims.
    rows.sort(key=lambda row: (order.index(row["figure"]), row["size"]))
    with (folder / "numbers.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    captions = read_captions(folder)
    key = f"{figure}-{size}"
    captions.pop(key, None)
    captions.pop(f"{key}-missing", None)
    if drawing:
        captions[key] = drawing.caption
    else:
        (folder / f"{key}.png").unlink(missing_ok=True)
    if missing:
        captions[f"{key}-missing"] = missing
    text = json.dumps(dict(sorted(captions.items())), indent=1, ensure_ascii=False)
    (folder / "captions.json").write_text(text + "\n", encoding="utf-8")


def read_captions(folder: Path) -> dict[str, str]:
    """Captions by "figure-size", and by "figure-size-missing" about the runs that it lacks."""
    path = folder / "captions.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def verdict(row: dict[str, str]) -> str:
    """How our number stands to what the paper's words admit; empty where it gives no number."""
    if not row["low"]:
        return ""
    if not row["ours"]:
        return "not reached"
    low, high, ours = (float(row[name]) for name in ("low", "high", "ours"))
    if low * (1 - 1e-9) <= ours <= high * (1 + 1e-9) or math.isclose(ours, low, abs_tol=1e-12):
        return "agrees"
    bound, word = (low, "below") if ours < low else (high, "above")
    if bound <= 0.0 or abs(ours / bound) > 10:
        return word
    # Two digits, but never an exponent.
    return f"{float(f'{100 * abs(ours / bound - 1):.2g}'):g}\N{NO-BREAK SPACE}% {word}"


def table(rows: list[dict[str, str]]) -> str:
    """Rows of one figure, all sizes, as a table of the page. The verdict is on the largest size that there is."""
    sizes = [size for size in SHOWN if any(row["size"] == size for row in rows)]
    heads = ["what", "settings", "paper", *(SHOWN[size] for size in sizes), "verdict"]
    lines = [f"| {' | '.join(heads)} |", f"| {' | '.join(['---'] * len(heads))} |"]
    by_key: dict[tuple[str, str], dict[str, dict[str, str]]] = {}
    for row in rows:
        by_key.setdefault((row["what"], row["settings"]), {})[row["size"]] = row
    for (what, settings), found in by_key.items():
        best = found[[size for size in sizes if size in found][-1]]
        unit = f" [{best['unit']}]" if best["unit"] else ""
        told = best["paper"].replace("-", "\N{MINUS SIGN}") if best["paper"][:1] in "-0123456789" else best["paper"]
        cells = [f"{what}{unit}", settings, told]
        for size in sizes:
            ours = found.get(size, {}).get("ours")
            cells.append("" if size not in found else number(float(ours), 4) if ours else "never")
        lines.append(f"| {' | '.join([*cells, verdict(best)])} |")
    return "\n".join(lines)


def block(figure: str, folder: Path) -> str:
    """What the page shows of a figure: its pictures, the larger size first, with captions, and its table."""
    captions, parts, shown = read_captions(folder), [], set()
    for size in reversed(SHOWN):
        path = folder / f"{figure}-{size}.png"
        # A figure that needs no run is the same at all sizes.
        if path.exists() and (picture := path.read_bytes()) not in shown:
            shown.add(picture)
            caption = captions.get(f"{figure}-{size}", "")
            parts.append(f"![{figure}, {SHOWN[size]}](figures/paper/{figure}-{size}.png)\n\n*{caption}*")
    rows = [row for row in read_rows(folder) if row["figure"] == figure and row["size"] in SHOWN]
    if rows:
        parts.append(table(rows))
    for size, word in SHOWN.items():
        if told := captions.get(f"{figure}-{size}-missing"):
            command = f"python scripts/paper/run.py {figure} --size {size}"
            parts.append(f"Not run here ({word}): {told}. `{command}` runs them.")
    return "\n\n".join(parts)
