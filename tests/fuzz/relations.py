"""Pairs of runs that must agree: the same test written, stopped, shared out, mirrored or measured in another way."""

from __future__ import annotations

import copy
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.maps.reading import read_map
from pgfmd.parts import series_of
from pgfmd.scene.output_section import NEAR_GAP
from pgfmd.scene.precision import best_precision
from pgfmd.scene.reading import scene_from_mapping
from pgfmd.symmetry import expected
from pgfmd.units import DIMENSIONS, UnitError, parse_quantity

from .comparing import UNITS, close, compared, within_uncertainty
from .declarations import KEYS, exponents
from .draw import Draw, Mapping, as_toml, written
from .faults import Fault
from .running import OUT_OF_TIME, pgfmd
from .scenes import Made

AGREES, DIFFERS = "agrees", "differs"
"""Outcomes of a pair that has been run."""
MIRRORED_ERROR = 1e-6
"""Relative difference of numbers of mirrored runs, whose sums are rounded in another order."""


class NotRun(Exception):
    """The scene itself does not run to an end, so there is nothing to compare; says how it ended."""


class Unlike(Exception):
    """The scene runs, but not in the other way; says how that ended."""


class Pair:
    """A scene, and a folder in which it is run in several ways.

    draw: decides what the relation leaves open. said: what the run of the scene as it is has said, once there is one.
    """

    def __init__(self, made: Made, folder: Path):
        self.made, self.folder = made, folder
        self.draw = Draw("pair", made.seed, made.index)
        self.said: str | None = None

    @property
    def scene(self) -> Mapping:
        """A copy that may be changed."""
        return copy.deepcopy(self.made.scene)

    def base(self, *changes: str) -> Path:
        """Runs the scene as it is. Raises NotRun."""
        code, self.said = self._run("base", self.made.scene, changes)
        if code:
            raise NotRun({2: "refused", 3: "failed", 75: OUT_OF_TIME}.get(code, f"exit code {code}"))
        return self.folder / "base"

    def other(self, scene: Mapping, *changes: str, name: str = "other") -> Path:
        """Runs it in another way. Raises Unlike, or NotRun where time has run out."""
        code, said = self._run(name, scene, changes)
        if code == 75:
            raise NotRun(OUT_OF_TIME)
        if code:
            raise Unlike(f"exit code {code}: {said[-300:]}")
        return self.folder / name

    def _run(self, name: str, scene: Mapping, changes: tuple[str, ...]) -> tuple[int, str]:
        path = self.folder / f"{name}.toml"
        path.write_text(as_toml(scene), encoding="utf-8")
        return pgfmd("run", str(path), "--out", str(self.folder / name), *changes)


@dataclass(frozen=True)
class Relation:
    """applies: whether a scene has what the relation needs. compare: runs it twice, and gives what differs."""

    compare: Callable[[Pair], list[Fault]]
    applies: Callable[[Made], bool] = lambda made: True

    def examine(self, pair: Pair) -> tuple[str, list[Fault]]:
        """An outcome in a word, and faults."""
        try:
            faults = self.compare(pair)
        except NotRun as why:
            return str(why), []
        except Unlike as why:
            return "unlike", [Fault("runs in one way, not in the other", str(why))]
        return (DIFFERS if faults else AGREES), faults


def _other_units(pair: Pair) -> list[Fault]:
    """Lengths, moduli and times scaled by powers of two: the same numbers, scaled, to the last bit."""
    most = 4 if pair.made.scene["solver"].get("precision") == "single" else 12
    powers = [pair.draw.choice([-1, 1]) * pair.draw.randint(1, most) for _ in range(3)]
    if pair.made.scene["solver"]["scheme"] == "inertialess" and pair.made.scene["rheology"]["model"] != "elastic":
        # Retardation times come from logarithms of relaxation times, whose rounding depends on the unit.
        powers[2] = 0
    if pair.made.scene["solver"]["scheme"] == "quasistatic" and (powers[0] + powers[1]) % 2:
        # Its softest modes are normalised by the square root of an energy per area, m Pa.
        powers[1] += 1

    def scale(exponents_of: tuple[int, int, int]) -> float:
        return math.ldexp(1.0, sum(power * exponent for power, exponent in zip(powers, exponents_of, strict=True)))

    def other(value: Any, dimension: str) -> Any:
        if isinstance(value, list):
            return [other(entry, dimension) for entry in value]
        try:
            return written(parse_quantity(value, dimension) * scale(exponents(dimension)), dimension)
        except UnitError:
            # A word, such as "auto" or "1.5 t_pl".
            return value

    scene = pair.scene
    for key in KEYS.values():
        keys = scene.get(key.section, {})
        if key.name in keys and (key.dimension in DIMENSIONS or key.kind == "times"):
            keys[key.name] = other(keys[key.name], "time" if key.kind == "times" else key.dimension)
    # The one length that no other key gives where the scene leaves it out.
    scene.setdefault("output", {}).setdefault("near_gap", other(f"{NEAR_GAP!r} m", "length"))
    name = scene["punch"].get("file")
    if name:
        found = read_map(pair.folder / name)
        sides = {} if found.size is None else {"size": np.array(found.size) * scale(exponents("length"))}
        np.savez(pair.folder / "scaled.npz", z=found.numbers * scale(exponents("length")), **sides)
        scene["punch"]["file"] = "scaled.npz"
    base = pair.base()
    return compared(base, pair.other(scene), factor=lambda unit: scale(UNITS[unit]) if unit else 1.0)


def _other_series(pair: Pair) -> list[Fault]:
    """The same relaxation written as another series: permuted, with weights of zero, with an element in two halves."""
    scene, draw = pair.scene, pair.draw
    rheology = scene["rheology"]
    resolved = scene_from_mapping(pair.made.scene, folder=pair.folder)
    series = series_of(resolved.rheology)
    if rheology.get("reference") == "instantaneous":
        scene["substrate"]["youngs_modulus"] = written(resolved.substrate.youngs_modulus, "modulus")
    elements = [(float(kappa), float(tau)) for kappa, tau in zip(series.kappa, series.tau, strict=True)]
    elements.insert(0, (0.0, float(pair.made.natural.time) * 3.0))
    if len(elements) > 1 and draw.chance(0.5):
        kappa, tau = elements.pop()
        elements += [(kappa / 2, tau), (kappa / 2, tau)]
    draw.shuffle(elements)
    scene["rheology"] = {"model": "prony", "kappa": [kappa for kappa, _ in elements],
                         "tau": [written(tau, "time") for _, tau in elements]}  # fmt: skip
    faults = compared(pair.base(), pair.other(scene))
    if rheology["model"] == "single":
        scene["rheology"] = rheology | {"model": "geometric", "elements": 1, "time_ratio": 3.0, "exponent": 0.7}
        faults += compared(pair.folder / "base", pair.other(scene, name="geometric"))
    return faults


def _mirrored(pair: Pair) -> list[Fault]:
    """A map turned over in x, in y, or about the diagonal."""
    scene, draw = pair.scene, pair.draw
    found = read_map(pair.folder / scene["punch"]["file"])
    heights, size = found.numbers, found.size
    turn = draw.choice(["x", "y", "diagonal"])
    heights = {"x": heights[:, ::-1], "y": heights[::-1], "diagonal": heights.T}[turn]
    size = scene["punch"].get("file_size") or [written(side, "length") for side in size]
    if turn == "diagonal":
        size = size[::-1]
        if "prestrain" in scene["substrate"]:
            scene["substrate"]["prestrain"] = scene["substrate"]["prestrain"][::-1]
    np.save(pair.folder / "mirrored.npy", heights)
    scene["punch"] |= {"file": "mirrored.npy", "file_size": size}
    base, other = pair.base(), pair.other(scene)
    error = 1e-2 if pair.made.scene["solver"].get("precision") == "single" else MIRRORED_ERROR
    return close(base, other, {"preload_N": 10 * error, "time_to_preload_s": error, "pull_off_force_N": error})


def _thinned(pair: Pair) -> list[Fault]:
    """`output.every`: rows are left out, and nothing else changes."""
    scene = pair.scene
    scene.setdefault("output", {})["every"] = pair.draw.choice([2, 3, 10, 1000])
    base, thin = pair.base("output.every=1"), pair.other(scene)
    faults = compared(base, thin, names=("events", "patches", "sites"))
    for name in ("curve.csv", "energy.csv"):
        if not (base / name).exists():
            continue
        every, some = ((folder / name).read_text(encoding="utf-8").splitlines() for folder in (base, thin))
        left = iter(every)
        if not all(row in left for row in some):
            faults.append(Fault(f"{name}: thinned rows are not rows of the whole, in its order"))
        if some[-1] != every[-1] or some[:2] != every[:2]:
            faults.append(Fault(f"{name}: the first or the last row is left out"))
    return faults


def _gone_on(pair: Pair) -> list[Fault]:
    """Stopped at some steps, and gone on with."""
    import pgfmd.runner
    from tests.stopper import StopAfter

    base = pair.base()
    steps = len((base / "curve.csv").read_text(encoding="utf-8").splitlines()) - 2
    at_work, pgfmd.runner.StopSignals = pgfmd.runner.StopSignals, StopAfter
    folder = pair.folder / "other"
    try:
        for _ in range(3):
            StopAfter.steps = pair.draw.randint(2, max(3, steps // 2))
            code, said = pair._run("other", pair.made.scene, ())
            if code == 0:
                break
            if code != 75:
                raise Unlike(f"exit code {code} on the way: {said[-300:]}")
    finally:
        pgfmd.runner.StopSignals, StopAfter.steps = at_work, math.inf
    if code:
        pair.other(pair.made.scene)
    return compared(base, folder)


def _resolved(pair: Pair) -> list[Fault]:
    """The resolved scene that a run leaves, run itself."""
    base = pair.base()
    code, said = pgfmd("run", str(base / "scene.resolved.toml"), "--out", str(pair.folder / "other"))
    if code:
        raise NotRun(OUT_OF_TIME) if code == 75 else Unlike(f"exit code {code}: {said[-300:]}")
    return compared(base, pair.folder / "other")


def _other_outputs(pair: Pair) -> list[Fault]:
    """What is written beside the curve does not change it."""
    scene, given = pair.scene, pair.made.scene.get("output", {})
    flags = [key for key in KEYS.values() if key.section == "output" and key.kind == "flag"]
    resolved = scene_from_mapping(pair.made.scene, folder=pair.folder)
    for key in flags:
        if pair.draw.chance(0.6):
            scene["output"] = scene.get("output", given) | {key.name: not getattr(resolved.output, key.name)}
    # Who watches the contact tells of jumps in events.csv as well.
    tables = ("curve", "energy", "patches", "sites")
    # Known with an audit only.
    audited = ("viscous_J", "energy_residual", "work_uncertainty_J", "work_of_separation_uncertainty_J")
    return compared(pair.base(), pair.other(scene), names=tables, but=audited)


def _other_ranks(pair: Pair) -> list[Fault]:
    """Run on two or three ranks."""
    ranks = pair.draw.choice([2, 3])
    (pair.folder / "base.toml").write_text(as_toml(pair.made.scene), encoding="utf-8")
    command = [sys.executable, "-m", "pgfmd.cli", "run", "base.toml", "--out", "other"]
    # First, while this process has not loaded MPI.
    command = ["mpirun", "-n", str(ranks), *command]
    done = subprocess.run(command, cwd=pair.folder, capture_output=True, text=True, check=False)
    base = pair.base()
    if done.returncode:
        few = "use at most" in done.stderr
        raise NotRun("too few points for the ranks") if few else Unlike(f"{done.returncode}: {done.stderr[-300:]}")
    return [Fault(f"{one.label} on {ranks} ranks", one.text) for one in compared(base, pair.folder / "other")]


def _unfolded(pair: Pair) -> list[Fault]:
    """On all points of a punch that is its own mirror image, instead of a part of them."""
    part, whole = pair.base("solver.symmetry=auto"), pair.other(pair.scene, "solver.symmetry=none")
    resolved = scene_from_mapping(pair.scene, ["solver.symmetry=auto"], folder=pair.folder)
    # Where nothing is left out, nothing may differ.
    return within_uncertainty(part, whole) if expected(resolved).mirror else compared(part, whole)


def _in_double(pair: Pair) -> list[Fault]:
    """In the precision that is chosen, and in mixed precision where a larger grid would get that, against double."""
    base = pair.base("solver.precision=double")
    chosen = scene_from_mapping(pair.scene, ["solver.precision=auto"], folder=pair.folder)
    other = pair.other(pair.scene, "solver.precision=auto", name="auto")
    if chosen.solver.precision == "mixed":
        return within_uncertainty(base, other)
    faults = compared(base, other)
    if not faults and _mixed_on_a_larger_grid(chosen):
        try:
            mixed = pair.other(pair.scene, "solver.precision=mixed", name="mixed")
        except Unlike as why:
            # Nobody has chosen it for this scene; a failure that is told misleads nobody.
            raise NotRun("fails in mixed precision") from why
        faults += within_uncertainty(base, mixed)
    return faults


def _mixed_on_a_larger_grid(scene: Any) -> bool:
    """Whether nothing but its small grid keeps a scene from mixed precision."""
    grid = scene.grid.model_copy(update={"n": 4096})
    return best_precision(scene.model_copy(update={"grid": grid})).precision == "mixed"


def _has_a_map(made: Made) -> bool:
    return made.scene["punch"]["pattern"] == "file"


RELATIONS: dict[str, Relation] = {
    "units": Relation(_other_units, lambda made: "compliance_file" not in made.scene["substrate"]),
    "series": Relation(_other_series),
    "mirror": Relation(_mirrored, _has_a_map),
    "every": Relation(_thinned),
    "resume": Relation(_gone_on),
    "resolved": Relation(_resolved),
    "outputs": Relation(_other_outputs),
    "ranks": Relation(_other_ranks),
    "symmetry": Relation(_unfolded, lambda made: made.scene["solver"]["scheme"] == "inertialess"),
    "precision": Relation(_in_double),
}
"""By their names on the command line."""
