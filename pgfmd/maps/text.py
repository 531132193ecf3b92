"""Height maps in text files: matrices, with or without a header, and tables of x, y and z."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from pgfmd.files.number_block import NumberBlock, read_number_block
from pgfmd.files.numerals import is_missing, is_numeral, value
from pgfmd.files.text_lines import cells_of, titles_of

from .header import Header, is_other_unit, understood
from .raw import METRE, Array, RawMap, Unit, unit_of

COORDINATES = ("x", "y", "z")
HEIGHT_NAMES = ("z", "height", "heights", "höhe", "topography", "elevation")
UNEVEN = 0.02
"""Relative differences of steps between places that rounding explains."""
FEWEST_POINTS = 0.5
"""Share of a grid's points that a table of places must hold to be taken for one."""
ROUNDINGS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Shares of the range of a coordinate by which places in one line of a grid may differ."""


def read_text_map(path: Path) -> RawMap:
    """The map of a text file. Raises ValueError for what is none, or may be another thing; MeasurementError."""
    block = read_number_block(path)
    _require_one_block(block)
    header = understood([*block.preamble, *block.below])
    columns = block.values.shape[1]
    names = _columns(block)
    if all(name in names for name in COORDINATES):
        return _of_places(block, header, [names[name] for name in COORDINATES])
    if columns == 2 and len(block.values) > 2:
        raise ValueError("has two columns, as a profile along a line: expected a matrix of heights, or x, y and z")
    if columns == 3 and len(block.values) > 3:
        return _of_places(block, header, [_Column(place) for place in range(3)])
    return _matrix(block, header)


def _require_one_block(block: NumberBlock) -> None:
    """ValueError where other lines look like rows of the same map: a word between them has cut it in two."""
    width = block.values.shape[1]
    lines = [*block.preamble, *block.below]
    if _axis_in(block) is not None:
        lines.remove(block.preamble[-1])
    for line in lines:
        cells = cells_of(line, block.delimiter)
        if len(cells) >= width and 2 * sum(map(is_numeral, cells)) > len(cells):
            word = next((cell for cell in cells if not is_numeral(cell) and not is_missing(cell)), "")
            why = f"{word!r} in it is no number" if word else "there are words between it and the others"
            raise ValueError(
                f"more than one block of numbers: the line {line.strip()[:40]}... is not with the others, as {why}; keep one "
                "map, and mark missing pixels by NaN"
            )


def _axis_in(block: NumberBlock) -> Array | None:
    """The places along x in the line above the numbers, where that holds numbers behind a word; else None."""
    cells = block.header
    if len(cells) < 3 or is_numeral(cells[0]) or not all(map(is_numeral, cells[1:])):
        return None
    return np.array([value(cell, "," if block.delimiter != "," and "," in cell else ".") for cell in cells[1:]])


class _Column(NamedTuple):
    """A column of places or heights; odd_unit: the name of a unit that is none of length."""

    place: int
    unit: Unit | None = None
    odd_unit: str = ""


def _columns(block: NumberBlock) -> dict[str, _Column]:
    """Place and unit of the columns x, y and z by the names above them, such as "X [µm]", "y/um", "Height (nm)"; units may
    stand in a line of their own below the names."""
    width, above = block.values.shape[1], [line for line in block.preamble if line.strip()]
    if not above:
        return {}
    below = cells_of(above[-1], block.delimiter)
    of_units = (
        len(below) == width and len(above) > 1 and all(_unit(cell) or is_other_unit(_bare(cell)) for cell in below)
    )
    titles = titles_of(above[-2 if of_units else -1], block.delimiter, width)
    found: dict[str, _Column] = {}
    for place, title in enumerate(titles):
        mark = next((mark for mark in "[(/" if mark in title), None)
        name, _, rest = title.partition(mark) if mark else (title, "", "")
        word = name.strip(' "').lower().removesuffix("position").rstrip(" -_")
        word = "z" if word in HEIGHT_NAMES else word
        if word in COORDINATES:
            text = _bare(below[place]) if of_units else rest.strip(' ])"')
            found.setdefault(word, _Column(place, _unit(text), text if is_other_unit(text) else ""))
    return found


def _bare(cell: str) -> str:
    return cell.strip(' "').strip("()[]").strip()


def _unit(text: str) -> Unit | None:
    try:
        return unit_of(text)
    except ValueError:
        return None


def _of_places(block: NumberBlock, header: Header, columns: list[_Column]) -> RawMap:
    """The map of a table of x, y and z."""
    x, y, z = (block.values[:, column.place] for column in columns)
    # That of each, or the one of all.
    of_x, of_y = (column.unit or header.lateral or header.common for column in columns[:2])
    odd_unit = columns[2].odd_unit or header.odd_unit
    unit = columns[2].unit or (None if odd_unit else header.unit)
    known = np.isfinite(x) & np.isfinite(y)
    found = _grid(x[known], y[known], z[known])
    if found is None:
        raise ValueError(
            "has three columns, as x, y and z of points, but the points are on no grid: interpolate them to a grid of even "
            "steps first, for instance by scipy.interpolate.griddata"
        )
    heights, size = found
    size_unit = None
    if of_x is not None and of_y is not None:
        size, size_unit = (size[0] * of_x.metres, size[1] * of_y.metres), METRE
    kind = f"a table of x, y and z, {heights.shape[1]} x {heights.shape[0]} points"
    doubts = tuple(header.doubts)
    return RawMap(heights, kind, unit, odd_unit, size, size_unit, None, tuple(header.codes), doubts, block.notes)


def _grid(x: Array, y: Array, z: Array) -> tuple[Array, tuple[float, float]] | None:
    """Heights (rows along y, columns along x) and the size of a grid of places, half a step around it included; places
    that the table leaves out are NaN. None where the places are on no grid."""
    for rounding in ROUNDINGS:
        (columns, step_x), (rows, step_y) = _lines(x, rounding), _lines(y, rounding)
        count_x, count_y = int(columns.max(initial=0)) + 1, int(rows.max(initial=0)) + 1
        if step_x is None or step_y is None or z.size < FEWEST_POINTS * count_x * count_y:
            continue
        place = rows * count_x + columns
        if np.unique(place).size < place.size:
            continue
        heights = np.full(count_x * count_y, np.nan)
        heights[place] = z
        return heights.reshape(count_y, count_x), (count_x * step_x, count_y * step_y)
    return None


def _lines(places: Array, rounding: float) -> tuple[np.ndarray, float | None]:
    """Which line of a grid each place is on, from the lowest, and the step between lines; None for uneven steps."""
    order = np.argsort(places, kind="stable")
    sorted_places = places[order]
    spread = float(np.ptp(places)) if places.size else 0.0
    if spread == 0.0:
        return np.zeros(places.size, np.int64), None
    new = np.diff(sorted_places) > rounding * spread
    line = np.empty(places.size, np.int64)
    line[order] = np.concatenate([[0], np.cumsum(new)])
    count = int(new.sum()) + 1
    means = np.bincount(line, places, count) / np.bincount(line, minlength=count)
    steps = np.diff(means)
    step = (means[-1] - means[0]) / max(count - 1, 1)
    # Lines without a single point leave a gap of two steps or more.
    whole = np.round(steps / steps.min())
    if (np.abs(steps - whole * steps.min()) > UNEVEN * steps.min() * np.maximum(whole, 1.0)).any():
        return line, None
    if (whole > 1.0).any():
        line = np.concatenate([[0.0], np.cumsum(whole)]).astype(np.int64)[line]
        step = (means[-1] - means[0]) / float(whole.sum())
    return line, float(step)


def _matrix(block: NumberBlock, header: Header) -> RawMap:
    """The map of a matrix of heights, without a first row and column of places."""
    values, sides = block.values, None
    axis = _axis_in(block)
    if axis is not None:
        values = np.vstack([np.concatenate([[np.nan], axis]), values])
    labelled = _labelled(values) or _nonuniform(values)
    if labelled is not None:
        values, sides = labelled
    elif axis is not None or any(
        _counts(line) for line in (values[0], values[:, 0]) if line.size > 3 and _broken(values)
    ):
        raise ValueError(
            "its first row or column counts, or names places, and holds no heights: delete it, or both of them"
        )
    size, unit = header.size(values.shape)
    if size is None and sides is not None:
        size, unit = sides, header.lateral
    if {"ncols", "cellsize"} <= header.names:
        # A grid of geographic systems: its first row is the northernmost.
        values = values[::-1]
    kind = f"a matrix of {values.shape[1]} x {values.shape[0]} heights"
    doubts = tuple(header.doubts)
    return RawMap(
        values, kind, header.unit, header.odd_unit, size, unit, None, tuple(header.codes), doubts, block.notes
    )


def _labelled(values: Array) -> tuple[Array, tuple[float, float] | None] | None:
    """A matrix without its first row and column, where these are places, and the size of the map if they are more than
    numbers of rows and columns; None where the first row and column are heights."""
    x, y = values[0, 1:], values[1:, 0]
    if min(values.shape) < 3 or not (np.isnan(values[0, 0]) or _counts(x) or _counts(y)):
        return None
    steps_x, steps_y = np.diff(x), np.diff(y)
    if not (_even(steps_x) and _even(steps_y)):
        return None
    body = values[1:, 1:]
    if not np.isnan(values[0, 0]) and not (_counts(x) and _counts(y) and (body != np.round(body)).any()):
        return None
    if _counts(x) and _counts(y):
        return body, None
    if _counts(x) or _counts(y):
        raise ValueError("counts along one side, and has places along the other: give places along both, or neither")
    return _between(x, y, body)


def _between(x: Array, y: Array, body: Array) -> tuple[Array, tuple[float, float]]:
    """Heights at even places along x and y, in the order in which these rise, and the size of the map."""
    steps_x, steps_y = float(np.diff(x).mean()), float(np.diff(y).mean())
    body = body[:, ::-1] if steps_x < 0 else body
    body = body[::-1] if steps_y < 0 else body
    return body, (abs(steps_x) * x.size, abs(steps_y) * y.size)


def _nonuniform(values: Array) -> tuple[Array, tuple[float, float]] | None:
    """A matrix with places along x and y around a number in its corner that counts the columns, as gnuplot writes it. None
    for heights alone; ValueError where that can't be told."""
    if not _may_be_labelled(values):
        return None
    if values[0, 0] == values.shape[1] - 1:
        return _between(values[0, 1:], values[1:, 0], values[1:, 1:])
    raise ValueError(
        f"its first row and column rise evenly, as places along x and y do, around {values[0, 0]:g} in the corner: if they are "
        "places, write NaN there or a word; if they are heights, save the map as .npy"
    )


def _may_be_labelled(values: Array) -> bool:
    """Whether the first row and column, but not the second ones, rise evenly, as places do."""
    if min(values.shape) < 5:
        return False
    edges, inner = (values[0, 1:], values[1:, 0]), (values[1, 1:], values[1:, 1])
    return all(_even(np.diff(line)) for line in edges) and not any(_even(np.diff(line)) for line in inner)


def _counts(line: Array) -> bool:
    """Whether numbers count 0, 1, 2 ... or 1, 2, 3 ..."""
    return bool(line[0] in (0.0, 1.0) and (np.diff(line) == 1.0).all())


def _broken(values: Array) -> bool:
    """Whether a matrix holds numbers other than whole ones."""
    return bool((values[np.isfinite(values)] % 1.0 != 0.0).any())


def _even(steps: Array) -> bool:
    mean = float(steps.mean()) if steps.size else 0.0
    return mean != 0.0 and bool((np.abs(steps - mean) <= UNEVEN * abs(mean)).all())
