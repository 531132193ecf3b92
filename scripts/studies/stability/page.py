"""Puts the table of scripts/studies/stability/run.py into docs/evidence/stability.md.

python -m scripts.studies.stability.run --csv docs/figures/stability.csv
python -m scripts.studies.stability.page
"""

from __future__ import annotations

import csv

from ..pages import FIGURES, fill, page_named

SOURCE, PAGE = FIGURES / "stability.csv", page_named("stability.md")


def lines(rows: list[dict[str, str]]) -> list[str]:
    """The table as Markdown, a heading for every axis."""
    table, axis = [], None
    for row in rows:
        if row["axis"] != axis:
            axis = row["axis"]
            table += [
                "",
                f"## {axis.capitalize()}",
                "",
                "| scene | settings | outcome | steps | pairs | jumps | residual |",
            ]
            table += ["| --- | --- | --- | --- | --- | --- | --- |"]
        settings = row["settings"].replace("rheology.model=geometric ", "") or "as shipped"
        ran = row["verdict"] in ("ok", "stopped")
        numbers = (
            [row["steps"], row["pairs"], row["jumps"], f"{100 * float(row['residual']):.2g} %"] if ran else [""] * 4
        )
        outcome = row["finished"] if ran else f"{row['verdict']}: {cause(row['finished'])}"
        table.append(f"| {row['scene']} | `{settings}` | {outcome} | " + " | ".join(numbers) + " |")
    return [*table, ""]


def cause(message: str) -> str:
    """The first problem of a refused scene."""
    return message.split(" - ", 1)[-1].split(";")[0].replace("|", "\\|")


def main() -> None:
    with open(SOURCE, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    fill(PAGE, "table", lambda name: "\n".join(lines(rows)))
    print(f"{PAGE}: {len(rows)} cases")


if __name__ == "__main__":
    main()
