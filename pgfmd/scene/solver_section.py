"""The sections [solver] and [solver.gfmd] of a scene."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import PrivateAttr, field_validator

from pgfmd.schemes import registry

from .fields import OneOf, Section, key, number, quantity, refuse

PRECISIONS = ("auto", "double", "mixed", "single")
INSTEAD_OF_OMEGA_AND_DT = ("omega_tau", "steps_per_tau", "fast_pull")
"""The keys of [solver.gfmd] that omega and dt, given both, leave without a use."""


class GfmdKeys(Section):
    """The inertia and the step of the scheme `gfmd`; no other scheme reads them."""

    omega_tau: float = number(
        "omega tau_min: frequency omega of the auxiliary inertia times the shortest relaxation time",
        2.0 * math.pi,
        above=0.0,
    )
    steps_per_tau: float = number("time steps in the shortest relaxation time", 20.0, above=0.0)
    fast_pull: float = number(
        "largest motion of the punch in a step, in ranges of adhesion; where it shortens the step, omega dt stays "
        "omega_tau/steps_per_tau",
        0.01,
        above=0.0,
    )
    omega: float | None = quantity(
        "angular frequency", "frequency omega of the inertia, instead of omega_tau; needs dt", None
    )
    dt: float | None = quantity("time", "time step, instead of steps_per_tau and fast_pull; needs omega", None)

    @field_validator("omega", mode="before")
    @classmethod
    def _not_in_hertz(cls, value: object) -> object:
        if isinstance(value, str) and "hz" in value.lower():
            raise refuse(value, "an angular frequency in rad/s", "multiply by 2 pi and write rad/s")
        return value


class Solver(Section):
    """The numerics."""

    scheme: Annotated[str, OneOf(registry.names)] = key(
        "; ".join(f"`{entry.name}`: {entry.meaning}" for entry in registry.entries()), registry.DEFAULT
    )
    modulus: Literal["relaxed", "instantaneous"] = key(
        "modulus of `quasistatic`: `relaxed`, E(0), or `instantaneous`, E(infinity)", "relaxed"
    )
    accuracy: float = number(
        "relative error allowed in one step of `inertialess` or `quasistatic`; `gfmd` has [solver.gfmd]",
        1e-2,
        at_least=1e-8,
        at_most=0.3,
    )
    order: Literal[2, 1] = key(
        "order of the steps of `inertialess`: 2 (two stages, SDIRK2) or 1 (implicit Euler); `gfmd` is always of order 2",
        2,
    )
    precision: Literal["auto", "double", "mixed", "single"] = key(
        "`double`; `mixed`: single within conjugate gradients, double in all that lasts; `single`: all fields; `auto`: "
        "`mixed` where that has the error of `double` and costs less, else `double`",
        "auto",
    )
    symmetry: Literal["auto", "none"] = key(
        "`auto`: a viscoelastic `inertialess` scene that is its own mirror image (x -> -x, or y -> -y as well) is stepped "
        "on a half or a quarter of its points; `none`: on all",
        "auto",
    )
    coarse_grid: Literal["auto", "always", "none"] = key(
        "`auto`: conjugate gradients use an additional coarser grid in viscoelastic `inertialess` scenes whose transforms "
        "have 1000 points a side or more; `always`: in smaller ones, too, where it can be; `none`: never",
        "auto",
    )
    max_steps: int = key("largest number of steps", 1_000_000, ge=1)
    _automatic: bool = PrivateAttr(default=False)

    @property
    def automatic_precision(self) -> bool:
        """Whether the precision was chosen for the scene, which has "auto"; a run that goes on keeps the one that it
        began with."""
        return self._automatic

    def chosen(self, precision: str) -> Solver:
        """The same section with a precision that was chosen for the scene."""
        solver = self.model_copy(update={"precision": precision})
        solver._automatic = True
        return solver
