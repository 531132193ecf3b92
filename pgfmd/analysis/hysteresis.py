"""Parts of the hysteresis: by the energy audit of the run, and in comparison with its quasi-static twin.

The audit distinguishes dissipation in viscous elements from energy released by jumps of the surface. In a viscous
elastomer there are hardly any jumps: a snap takes a finite time, and its energy is dissipated in viscous elements. So
the audit of a viscous run can't distinguish multistability from a steadily moving crack.

The twin can. It is the same loop at vanishing speed, where the elastomer is always relaxed and only jumps dissipate
energy. The rest of the run's loss is due to its finite speed. It consists of viscous losses, and of additional snaps,
because more contact is made or kept. These two act together and can't be separated by the difference of two runs. The
paper concludes the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pgfmd.results import Results
from pgfmd.results.curve import Loop, column, net_work
from pgfmd.scene.quasistatic_twin import NO_TIME, SAME_SECTIONS
from pgfmd.schemes import registry

from .scene_differences import differences

SAME_LOOP = 0.02
"""Preloads of a run and its twin may differ by this fraction."""


@dataclass(frozen=True)
class Audit:
    """The run's own energy audit at its last row [J]: work = viscous + released + stored + residual.

    stored: elastic and adhesive energy at that time. After a fast detachment the surface is not yet at rest, and its
    energy is dissipated later.
    """

    work: float
    viscous: float
    released: float
    stored: float
    residual: float

    def share(self, part: float) -> float | None:
        """A part [J] over the net work; None where that is not positive."""
        return part / self.work if self.work > 0.0 else None


@dataclass(frozen=True)
class Twin:
    """A loop [J] against that of its quasi-static twin [J]; remarks: what else differs between the two."""

    name: str
    loop: float
    twin_loop: float
    remarks: tuple[str, ...]

    @property
    def rest(self) -> float:
        """What the finite speed adds [J]: viscous losses and coaction."""
        return self.loop - self.twin_loop

    @property
    def multistability_share(self) -> float | None:
        """The twin's loop over this one."""
        return self.twin_loop / self.loop if self.loop > 0.0 else None

    @property
    def rest_share(self) -> float | None:
        """The rest over this loop."""
        return self.rest / self.loop if self.loop > 0.0 else None


def audit_of(results: Results) -> Audit | None:
    """The audit of a run, None if it kept none."""
    energy = results.energy
    if energy is None or not len(energy):
        return None
    names = ("work", "viscous", "released", "elastic", "adhesive", "residual")
    work, viscous, released, elastic, adhesive, residual = (float(column(energy, f"{name} [J]")[-1]) for name in names)
    return Audit(work, viscous, released, elastic + adhesive, residual)


def twin_of(results: Results, loop: Loop, twin: Results) -> Twin:
    """A run in comparison with its quasi-static twin.

    Loops are those integrated by the runs. Differences of the two scenes other than rheology, solver and output become
    remarks.
    """
    other = Loop.of(twin)
    return Twin(str(twin.directory), net_work(loop), net_work(other), tuple(_remarks(results, loop, twin, other)))


def _remarks(results: Results, loop: Loop, twin: Results, other: Loop) -> list[str]:
    found = differences(results.scene, twin.scene, SAME_SECTIONS, NO_TIME)
    remarks = [f"{key} differs: {mine} here, {its} in the twin" for key, mine, its in found]
    if not is_quasistatic(twin.scene):
        remarks.append(
            "the twin is neither quasi-static nor elastic: run the same scene with --set solver.scheme=quasistatic"
        )
    for name, result, curve in (("this run", results, loop), ("the twin", twin, other)):
        if not curve.retracted or abs(curve.force[-1]) > 1e-3 * np.max(np.abs(curve.force)):
            remarks.append(f"the loop of {name} is not closed: {result.run.get('finished', 'the run goes on')}")
    preloads = loop.preload, other.preload
    if abs(preloads[1] - preloads[0]) > SAME_LOOP * max(preloads):
        remarks.append(f"preloads differ: {preloads[0]:.4g} N here, {preloads[1]:.4g} N in the twin")
    return remarks


def is_quasistatic(scene: dict) -> bool:
    """Whether a resolved scene has no viscous losses: the quasi-static scheme with the relaxed modulus, or an elastic
    substrate."""
    solver, rheology = scene.get("solver", {}), scene.get("rheology", {})
    scheme = registry.scheme_in(solver)
    relaxed = scheme.timeless and solver.get("modulus", "relaxed") == "relaxed"
    # With inertia an elastic substrate dissipates, too.
    return relaxed or (rheology.get("model") == "elastic" and not scheme.inertia)
