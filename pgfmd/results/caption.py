"""The line below a picture about its run: scene, speed, grid and date. No MPI."""

from __future__ import annotations

import time
from datetime import datetime

from pgfmd.files.storage import SCENE_FILE
from pgfmd.schemes import registry
from pgfmd.units import handy_quantity, parse_quantity

from .reading import Results

SEPARATOR = "  ·  "


def about(results: Results) -> str:
    """Title (or folder), speed, n and date of a run, as far as they are known: "tri-tack  ·  1 µm/s  ·  n = 512  ·
    28 Nov 2026"."""
    name = results.scene.get("title") or results.directory.name
    points = results.scene.get("grid", {}).get("n")
    parts = [name, speed_of(results), f"n = {points}" if points else "", date_of(results)]
    return SEPARATOR.join(part for part in parts if part)


def speed_of(results: Results) -> str:
    """The speed of the punch, both where it retracts at another one; "quasi-static" where it has none."""
    drive, solver = (results.scene.get(section, {}) for section in ("drive", "solver"))
    if registry.scheme_in(solver).timeless:
        return "quasi-static"
    if "speed" not in drive:
        return ""
    speeds = [parse_quantity(drive[key], "speed") for key in ("speed", "retract_speed") if key in drive]
    texts = [handy_quantity(speed, "speed").replace("um", "µm") for speed in speeds]
    return texts[0] if len(set(texts)) == 1 else f"{texts[0]} in, {texts[1]} out"


def date_of(results: Results) -> str:
    """The day on which the run began; of one that has no record yet, on which its scene was written."""
    links = results.run.get("links") or []
    try:
        day = datetime.fromisoformat(links[0]["started"]) if links else _written(results)
    except (KeyError, TypeError, ValueError, OSError):
        return ""
    return f"{day.day} {day:%b %Y}"


def _written(results: Results) -> datetime:
    return datetime(*time.localtime((results.directory / SCENE_FILE).stat().st_mtime)[:6])
