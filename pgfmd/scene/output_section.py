"""The section [output] of a scene: what a run writes, and when."""

from __future__ import annotations

from pydantic import field_validator
from pydantic_core import PydanticCustomError

from pgfmd.units import UnitError, format_quantity

from .fields import Section, key, quantity, refuse, snapshot_time

NEAR_GAP = 500e-9
"""Gap [m] below which a point looks closed in an optical image: about the wavelength of light."""


class Output(Section):
    """What is written."""

    directory: str | None = key("folder of the results; by default `out/<scene name>`", None, min_length=1)
    snapshots: tuple[str, ...] = key(
        'when fields are written: times ("3 s") or fractions of the time to the preload ("1.125 t_pl")', ()
    )
    every: int = key("number of steps between two rows of the curve", 1, ge=1)
    surface: bool = key("whether snapshots hold the surface of the whole cell", False)
    near_gap: float = quantity(
        "length", "gap below which a point is near, as an optical image sees it: `near_area` of the curve", NEAR_GAP
    )
    energy: bool = key("whether the energy audit is kept", True)
    patches: bool = key(
        "whether contact patches are listed, and the times at which summits, saddles and valleys join and leave", True
    )

    @field_validator("snapshots", mode="before")
    @classmethod
    def _snapshots(cls, value: object) -> tuple[str, ...]:
        if not isinstance(value, (list, tuple)):
            raise refuse(value, 'a list of times such as ["3 s", "1.125 t_pl"]', "write it in square brackets")
        texts, problems = [], []
        for entry in value:
            try:
                time, relative = snapshot_time(entry)
                texts.append(f"{time!r} t_pl" if relative else format_quantity(time, "time"))
            except UnitError as error:
                problems.append((entry, error.expected, error.cure))
        if problems:
            raise PydanticCustomError("scene", "expected a time", {"problems": problems})
        return tuple(texts)

    @property
    def snapshot_times(self) -> list[tuple[float, bool]]:
        """Every snapshot as (value, relative): a time [s], or a fraction of the time to the preload where relative."""
        return [snapshot_time(text) for text in self.snapshots]
