"""Which figures there are, the studies each takes its runs from, and who draws it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from . import beyond, cell, evolution, fullness, printed, rheologies, sensitivity, tack
from .drawing import Drawing
from .pool import Runs


@dataclass(frozen=True)
class Figure:
    """A figure of docs/evidence/paper.md. of: what the paper calls it, empty where it goes beyond; studies: files of this
    folder, empty where no run is needed."""

    draw: Callable[[Runs], Drawing]
    of: str = ""
    studies: tuple[str, ...] = ()


FIGURES: dict[str, Figure] = {
    "surfaces": Figure(printed.surfaces, "surfs"),
    "response": Figure(rheologies.response, "maxwellStuff"),
    "tri": Figure(tack.tri, "FDtri", ("tri",)),
    "contact": Figure(evolution.tri, "tri1ums", ("contact",)),
    "moduli": Figure(rheologies.moduli, "FDrheo a"),
    "rheology": Figure(tack.rheology, "FDrheo b-d", ("rheology",)),
    "hex": Figure(tack.hexagonal, "FDhex", ("hex",)),
    "approach": Figure(evolution.hexagonal, "hex1ums", ("approach",)),
    "sketch": Figure(cell.sketch, "model", ("cell",)),
    "compliance": Figure(cell.compliance, "complianceCorr", ("cell",)),
    "profile": Figure(printed.profile, "printCurv"),
    "curvature": Figure(sensitivity.curvature, "", ("curvature-tri", "curvature-hex")),
    "still": Figure(sensitivity.still, "", ("still-tri", "still-hex")),
    "full": Figure(fullness.full, "", ("full-tri",)),
    "curved": Figure(tack.curved, "", ("curved-tri", "curved-hex")),
    "range": Figure(sensitivity.ranges, "", ("range",)),
    "halved": Figure(sensitivity.halved, "", ("halved",)),
    "broad": Figure(beyond.broad, "", ("dma-tri", "dma-hex")),
    "free": Figure(beyond.free, "", ("free-tri", "free-hex")),
    "split": Figure(beyond.split, "", ("split-tri", "split-hex")),
}
"""Figures by the names of their files. The studies of the first ones own the runs that later ones share."""

STUDIES = tuple(dict.fromkeys(study for figure in FIGURES.values() for study in figure.studies))
"""Every study, in the order of the figures."""
