"""Maps of a page: snapshots as small PNG images, all of a kind on one scale, and what the slider says of each.

Large maps are made smaller by blocks of points: a block has the mean of its gaps and tractions, and the class (contact,
near, ...) that most of its points have.
"""

from __future__ import annotations

import base64
import functools
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgfmd.plots.curves import axis_unit
from pgfmd.plots.maps import class_numbers, gap_classes, robust_limit, round_length
from pgfmd.results import Results
from pgfmd.results.curve import Loop

from .wording import entry

Array = NDArray[np.float64]
MOST_BYTES = 2_200_000
"""Of all images of a page as texts (base64)."""
SIDES = (384, 256, 192, 128, 96)
"""Largest sides of an image [pixels] that are tried until all images fit."""
MARGIN = 0.8
"""All snapshots may have this share of the size that one of them foretells."""
FEW = 8
"""Snapshots that are all read at once."""
MOST_FRAMES = 60
"""Snapshots that a slider has; of more, so many evenly chosen ones."""
OUTSIDE = 255
"""Index of the transparent colour: outside of the punch."""
LEVELS = 254
"""Colours of a scale, from 0 on."""
FAR_GAP = 4.0
"""End of the scale of gaps, as a multiple of the near gap."""


@dataclass(frozen=True)
class Source:
    """A snapshot to be shown: of which run, its number there, and what the caption begins with."""

    results: Results
    snapshot: int
    name: str


@dataclass(frozen=True)
class Slides:
    """What the slider of a page shows: data for page.js, and what is to be said of it."""

    data: dict[str, Any]
    note: str


def frames_of(results: Results) -> list[Source]:
    """The snapshots of a run, evenly chosen where there are more than MOST_FRAMES. ResultError if they can't be read."""
    labels = results.labels
    chosen = evenly(len(labels), MOST_FRAMES)
    return [Source(results, snapshot, labels[snapshot]) for snapshot in chosen]


def evenly(count: int, most: int) -> list[int]:
    """Numbers from 0 to count - 1, at most so many, the first and the last among them."""
    if count <= most:
        return list(range(count))
    return sorted({round(place) for place in np.linspace(0, count - 1, most)})


def slides(sources: Sequence[Source], loops: dict[int, Loop], total: int = 0) -> Slides | None:
    """The images of snapshots, as large as MOST_BYTES allows; None without any.

    loops: of the runs, by id() of the results, for the mark on the curve: none for a run that is not among them. total:
    how many snapshots there are, where these are some of them.
    """
    if not sources:
        return None
    scales = _Scales(sources)
    frames: list[dict[str, Any]] = []
    for side in SIDES:
        last = side == SIDES[-1]
        # Snapshots of large grids take long to read: where there are many, one of them tells whether it is worth it.
        few = last or len(sources) <= FEW
        if (
            few
            or MARGIN * len(sources) * _size([_frame(sources[len(sources) // 2], scales, side, loops)]) <= MOST_BYTES
        ):
            frames = [_frame(source, scales, side, loops) for source in sources]
            if last or _size(frames) <= MOST_BYTES:
                break
    points, pixels = scales.points, max(frame["pixels"] for frame in frames)
    notes = []
    if pixels < points:
        notes.append(f"images have {pixels} pixels a side, the snapshots up to {points} points")
    if total > len(sources):
        notes.append(f"{len(sources)} of {total} snapshots are shown, evenly chosen")
    return Slides({"kinds": scales.kinds(), "frames": frames}, "; ".join(notes))


def _size(frames: Sequence[dict[str, Any]]) -> int:
    """Letters of all images."""
    return sum(len(image) for frame in frames for image in frame["images"])


class _Scales:
    """Classes of gaps, ends of the scales of gap [m] and traction [Pa], common to all snapshots; points: the most of a
    side."""

    def __init__(self, sources: Sequence[Source]):
        first = sources[0].results
        self.classes = gap_classes(first.contact_gap, first.near_gap, first.counts_overlap)
        self.points = max(source.results.fields["x"].shape[0] for source in sources)
        near = max(first.near_gap, first.contact_gap)
        self.gap = FAR_GAP * near if near > 0.0 else 1e-6
        self.traction, self.clipped = robust_limit(_sampled(sources))
        self.facts = {id(source.results): _facts(source.results) for source in sources}

    def kinds(self) -> list[dict[str, Any]]:
        """The kinds of maps, with their legend or their scale, for page.js."""
        pascal, metre = axis_unit([np.array([self.traction])], "Pa"), axis_unit([np.array([self.gap])], "m")
        legend = [{"colour": each.grey, "text": each.label} for each in self.classes]
        most, high = self.traction / pascal[0], self.gap / metre[0]
        return [
            {"name": "contact", "legend": legend},
            {"name": "gap", "colours": _stops("batlow"), "low": "0", "high": f"{high:.3g} or more",
             "text": f"gap ({metre[1]})"},
            {"name": "traction", "colours": _stops("vik"), "low": f"\N{MINUS SIGN}{most:.3g}", "high": f"{most:.3g}",
             "text": f"normal traction ({pascal[1]}), tension > 0" + (", beyond it cut off" if self.clipped else "")},
        ]  # fmt: skip

    def images(self, gap: Array, traction: Array, side: int) -> Iterator[NDArray[np.uint8]]:
        """Indices of colours, (rows, columns) with y downward, of the kinds of maps in their order."""
        factor = max(1, -(-len(gap) // side))
        yield commonest(class_numbers(gap, self.classes), factor, len(self.classes))[::-1]
        yield _indices(_means(np.clip(gap, 0.0, self.gap), factor) / self.gap)[::-1]
        share = np.clip(traction / self.traction, -1.0, 1.0)
        yield _indices(0.5 + 0.5 * _means(share, factor))[::-1]

    def palettes(self) -> list[list[int]]:
        """Red, green, blue of the colours of each kind."""
        greys = [int(each.grey[k : k + 2], 16) for each in self.classes for k in (1, 3, 5)]
        return [greys, *(_palette(name) for name in ("batlow", "vik"))]


def _facts(results: Results) -> tuple[Array, Array, float]:
    """Times [s] and forces [N] of a run's snapshots, and the side [m] of their maps."""
    time, force, x = (np.asarray(results.fields[name][:], float) for name in ("time", "force", "x"))
    return time, force, float(x[-1] - x[0]) * x.size / (x.size - 1) if x.size > 1 else 1e-6


def _sampled(sources: Sequence[Source]) -> Iterator[Array]:
    """Tractions, thinned: the end of a scale needs no more."""
    for source in sources:
        values = source.results.frame("traction", source.snapshot)
        stride = max(1, len(values) // 128)
        yield values[::stride, ::stride]


def _frame(source: Source, scales: _Scales, side: int, loops: dict[int, Loop]) -> dict[str, Any]:
    """A snapshot as page.js takes it."""
    results, number = source.results, source.snapshot
    times, forces, width = scales.facts[id(results)]
    time, force = float(times[number]), float(forces[number])
    gap, traction = results.frame("gap", number), results.frame("traction", number)
    images = [*scales.images(gap, traction, side)]
    bar = round_length(0.3 * width)
    when, pull = entry("", time, "s"), entry("", force, "N")
    return {
        "images": [_uri(image, palette) for image, palette in zip(images, scales.palettes(), strict=True)],
        "pixels": len(images[0]),
        "caption": f"{source.name}: {when.value} {when.unit}, {pull.value} {pull.unit}",
        "bar": {"share": bar / width, "text": "{0.value} {0.unit}".format(entry("", bar, "m"))},
        **_place(loops.get(id(results)), time),
    }  # fmt: skip


def _place(loop: Loop | None, time: float) -> dict[str, float]:
    """Indentation [m] and force [N] of a run at a time [s], where the mark of the slider is."""
    if loop is None:
        return {}
    return {name: float(np.interp(time, loop.time, getattr(loop, name))) for name in ("indentation", "force")}


def _blocks(values: Array, factor: int) -> Array:
    """(rows, columns, points of a block); NaN where blocks at the edge are not full."""
    wide = -len(values) % factor
    padded = np.pad(values, ((0, wide), (0, wide)), constant_values=np.nan)
    count = len(padded) // factor
    return padded.reshape(count, factor, count, factor).swapaxes(1, 2).reshape(count, count, factor**2)


def _means(values: Array, factor: int) -> Array:
    """The means of blocks; NaN where most of a block is outside of the punch."""
    if factor == 1:
        return values
    blocks = _blocks(values, factor)
    known = np.isfinite(blocks)
    inside = known.sum(axis=-1)
    total = np.where(known, blocks, 0.0).sum(axis=-1)
    return np.where(2 * inside >= factor**2, total / np.maximum(inside, 1), np.nan)


def commonest(numbers: Array, factor: int, count: int) -> NDArray[np.uint8]:
    """The class that most points of a block are in, the outside being one; of equally many the one of smaller gaps."""
    if factor == 1:
        return np.where(np.isnan(numbers), OUTSIDE, numbers).astype(np.uint8)
    blocks = _blocks(numbers, factor)
    votes = np.stack([*((blocks == each).sum(axis=-1) for each in range(count)), np.isnan(blocks).sum(axis=-1)])
    found = votes.argmax(axis=0)
    return np.where(found == count, OUTSIDE, found).astype(np.uint8)


def closest(numbers: Array, factor: int) -> NDArray[np.uint8]:
    """The class of the smallest gap in each block, for maps so coarse that contacts are smaller than a block."""
    if factor == 1:
        return np.where(np.isnan(numbers), OUTSIDE, numbers).astype(np.uint8)
    blocks = _blocks(numbers, factor)
    inside = np.isfinite(blocks)
    found = np.where(inside, blocks, OUTSIDE).min(axis=-1)
    return np.where(2 * inside.sum(axis=-1) >= factor**2, found, OUTSIDE).astype(np.uint8)


def _indices(shares: Array) -> NDArray[np.uint8]:
    """Colours of shares of a scale, 0 to 1."""
    with np.errstate(invalid="ignore"):
        found = np.rint(shares * (LEVELS - 1))
    return np.where(np.isnan(shares), OUTSIDE, found).astype(np.uint8)


def _colours(name: str, count: int) -> NDArray[np.uint8]:
    from cmcrameri import cm

    return np.asarray(255 * getattr(cm, name)(np.linspace(0.0, 1.0, count))[:, :3]).round().astype(np.uint8)


@functools.cache
def _palette(name: str) -> list[int]:
    return [int(part) for part in _colours(name, LEVELS).ravel()]


def _stops(name: str) -> list[str]:
    return [f"rgb({red},{green},{blue})" for red, green, blue in _colours(name, 9)]


def png(image: NDArray[np.uint8], palette: Sequence[int]) -> bytes:
    """A PNG file of indices into a palette, (rows, columns); OUTSIDE is transparent."""
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(image), "L")
    picture = picture.copy()
    picture.putpalette([*palette, *([0] * (768 - len(palette)))])
    file = io.BytesIO()
    picture.save(file, "PNG", optimize=True, transparency=OUTSIDE)
    return file.getvalue()


def _uri(image: NDArray[np.uint8], palette: Sequence[int]) -> str:
    return "data:image/png;base64," + base64.b64encode(png(image, palette)).decode()
