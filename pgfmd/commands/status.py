"""`pgfmd status` and `pgfmd verify`: how runs stand, and whether the files of results folders are whole. Serial."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pgfmd.errors import ResultError
from pgfmd.host import launch

from .names import named
from .printing import print_json

Folders = Annotated[list[Path], typer.Argument(metavar="DIR...", parser=named, help="Folders that runs write to.")]
COLUMNS = ("folder", "state", "phase", "way", "left", "step", "t [s]", "F [mN]", "preload [mN]", "checkpoint", "links",
           "steps/s")  # fmt: skip


def status(
    directories: Folders,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON: a list, an entry a folder.")] = False,
) -> None:
    """Show how the runs in results folders stand: state, progress, newest checkpoint, about how much is left."""
    from pgfmd.results.status import status_of

    found, wrong = [], False
    for directory in directories:
        try:
            found.append(status_of(directory))
        except ResultError as error:
            launch.complain(error)
            wrong = True
    if as_json:
        print_json([one.as_json() for one in found])
    elif len(directories) == 1:
        for one in found:
            print("\n".join(_lines(one)))
    elif found:
        _show_table(found)
    if wrong:
        raise typer.Exit(ResultError.exit_code)


def verify(directories: Folders) -> None:
    """Read every byte of checkpoints and snapshots, and compare them, and the tables, with their checksums."""
    from pgfmd.results.verify import verify as parts_of

    wrong = False
    for directory in directories:
        try:
            for part in parts_of(directory):
                print(part, flush=True)
                wrong |= not part.fine
        except ResultError as error:
            launch.complain(error)
            wrong = True
    if wrong:
        raise typer.Exit(ResultError.exit_code)


def span(seconds: float) -> str:
    """A time in the two largest of its units, such as "2 h 05 min"."""
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return f"{minutes} min"
    hours, minutes = divmod(minutes, 60)
    if hours < 48:
        return f"{hours} h {minutes:02d} min"
    days, hours = divmod(round(hours + minutes / 60.0), 24)
    return f"{days} d {hours} h"


def size(count: float) -> str:
    """Bytes in a handy unit."""
    for unit in ("bytes", "kB", "MB"):
        if count < 999.5:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} GB"


def _left(one: Any) -> str:
    """The remaining steps or time of a run, if they can be estimated."""
    if one.left_s is None:
        return one.left_remark
    remark = f", {one.left_remark}" if one.left_remark else ""
    return f"about {span(one.left_s)}{remark}"


def _lines(one: Any) -> list[str]:
    """A folder's status, a line a matter."""
    headline = [one.state + (f" ({one.why})" if one.why else "")]
    if one.progress is not None:
        what = "the programme" if one.stage else "the punch's way"
        headline.append(f"about {100 * one.progress:.0f} % of {what}")
    lines = {"title": one.title or ""}
    if one.holder:
        job = f", {one.holder['job']}" if one.holder["job"] else ""
        lines["on"] = f"{one.holder['host']}, process {one.holder['pid']}{job}, since {one.holder['since']}"
    if one.steps is not None:
        lines["step"] = ", ".join(_step(one))
    if one.force_N is not None:
        aim = f" (preload {one.preload_N * 1e3:.4g} mN)" if one.preload_N is not None else ""
        lines["force"] = f"{one.force_N * 1e3 + 0.0:.4g} mN{aim}"
    lines["left"] = _left(one)
    lines["rate"] = ", ".join(_rate(one))
    if one.checkpoint:
        file, steps, age, count = (one.checkpoint[name] for name in ("file", "steps", "age_s", "bytes"))
        lines["checkpoint"] = f"{file}: step {steps}, {span(age)} old, {size(count)}"
    if one.links:
        ranks = f", {one.ranks} rank{'s' * (one.ranks > 1)}" if one.ranks else ""
        taken = f", {span(one.wall_s)} until the checkpoint" if one.wall_s is not None else ""
        lines["links"] = f"{one.links}{ranks}{taken}"
    body = [f"  {name:<10} {text}" for name, text in lines.items() if text]
    return [f"{one.folder}: {', '.join(headline)}", *body, *(f"  warning: {text}" for text in one.warnings)]


def _step(one: Any) -> list[str]:
    texts = [f"{one.steps}"]
    if one.time_s is not None:
        texts.append(f"t = {one.time_s:.6g} s")
    if one.displacement_m is not None:
        texts.append(f"punch at {one.displacement_m * 1e6:.4g} um")
    if one.phase:
        texts.append(one.phase + _of_programme(one))
    if one.row_age_s is not None:
        texts.append(f"{span(one.row_age_s)} ago")
    return texts


def _of_programme(one: Any) -> str:
    """Where a run is in a programme of steps; empty for another one."""
    if one.stage is None:
        return ""
    cycle = f", cycle {one.cycle} of {one.cycles}" if one.cycles > 1 else ""
    return f" (step {one.stage} of {one.stages}{cycle})"


def _rate(one: Any) -> list[str]:
    texts = [] if one.steps_per_s is None else [f"{one.steps_per_s:.3g} steps/s"]
    if one.punch_m_per_s is not None:
        texts.append(f"the punch moves {one.punch_m_per_s * 1e9:.3g} nm in a second")
    return texts


def _show_table(found: list[Any]) -> None:
    """A line a folder; below, what does not fit."""
    rows = [COLUMNS, *map(_cells, found)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    for one in found:
        for text in ([one.why] if one.state == "damaged" else []) + one.warnings:
            print(f"{one.folder}: {text}")


def _cells(one: Any) -> tuple[str, ...]:
    """A folder's line in the table."""

    def number(value: float | None, factor: float = 1.0) -> str:
        return "" if value is None else f"{value * factor + 0.0:.4g}"

    why = one.why.partition(":")[0] if one.state in ("finished", "resumable") else ""
    return (
        one.folder,
        f"{one.state} ({why})" if why else one.state,
        one.phase or "",
        "" if one.progress is None else f"~{100 * one.progress:.0f} %",
        "" if one.left_s is None else f"~{span(one.left_s)}",
        "" if one.steps is None else str(one.steps),
        number(one.time_s),
        number(one.force_N, 1e3),
        number(one.preload_N, 1e3),
        f"{span(one.checkpoint['age_s'])}, {size(one.checkpoint['bytes'])}" if one.checkpoint else "",
        "" if one.links is None else str(one.links),
        number(one.steps_per_s),
    )
