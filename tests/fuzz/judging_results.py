"""What is a fault in the folder of a run, and in what the run said: each rule looks at one thing."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from pgfmd.errors import PgfmdError, RunError, SceneError
from pgfmd.files.table_reading import faults_of
from pgfmd.files.tables import CURVE, TABLES
from pgfmd.physics.adhesion.registry import law_of
from pgfmd.physics.drive import DETACHED
from pgfmd.results import load
from pgfmd.results.curve import SAME_STEP
from pgfmd.results.uncertainty import LEAST_LOOP, UNBALANCED, at_stake
from pgfmd.results.verify import verify
from pgfmd.solver.newton import NewtonSolver
from pgfmd.solver.simulation import STOPPED_PRELOAD, STOPPED_STEPS

from .declarations import KEYS
from .faults import Fault, of_exception

ROUNDING = 1e-9
"""Relative error of sums over the grid in double precision; forces of single precision are good to SINGLE."""
SINGLE = 1e-4
PRELOAD_ERROR = 0.01
"""Relative error of the preload that the search for it may leave."""
LEAST_SHARE = 1e-6
"""Residual of the audit, as a share of the largest energy, that nobody needs to be told of."""
STOPPED = 75
"""Exit code of a run that was stopped, and goes on with the same command."""
LEFT_OVERS = (".tmp", ".undo", ".lock")
NULLABLE = (
    "pull_off_force_N",
    "work_of_separation_J",
    "preload_N",
    "time_to_preload_s",
    "viscous_J",
    "energy_residual",
    "unbalanced_J",
    "jump_places_J",
)
"""Entries of the record that may be null, each where it does not apply."""
NEVER_NEGATIVE = (
    "steps", "jumps", "preload_N", "time_to_preload_s", "work_of_separation_J", "snap_in_force_N", "viscous_J",
    "released_J",
)  # fmt: skip
"""Entries of the record that are at least 0, apart from rounding."""
AREAS = ("overlap_area [m^2]", "contact_area [m^2]", "near_area [m^2]")
"""Columns of the curve that count points with a gap below a level, see `Folder.levels`."""
HELD = {"cosine": 0.5, "repulsive": 0.0}
"""Gap of the largest traction of a law, in ranges: below it a point is in contact. Of other laws it is found by the law."""


@dataclass
class Folder:
    """A run that has ended: its folder, its scene as resolved, its exit code and what it said."""

    path: Path
    scene: object
    code: int
    said: str

    @cached_property
    def record(self) -> dict | None:
        """`run.json`, in which NaN and infinity are no numbers; None if there is none."""
        path = self.path / "run.json"
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_number) if path.exists() else None

    @cached_property
    def results(self):
        return load(self.path)

    @cached_property
    def force(self) -> np.ndarray:
        return self.column("force [N]")

    @cached_property
    def time(self) -> np.ndarray:
        return self.column("time [s]")

    @property
    def largest_force(self) -> float:
        return float(np.abs(self.force).max(initial=0.0))

    @property
    def accuracy(self) -> float:
        """Relative accuracy of sums of tractions."""
        return SINGLE if self.scene.solver.precision == "single" else ROUNDING

    @property
    def unbalanced(self) -> float:
        """What a solve may leave out of balance [N]: traction of the law against that which bends the surface."""
        solver = self.scene.solver
        return 0.0 if solver.scheme == "gfmd" else NewtonSolver.force_share * solver.accuracy * self.scene.drive.preload

    @property
    def finished(self) -> bool:
        return self.record is not None and self.code == 0

    @property
    def cell(self) -> float:
        """Area of a grid point [m^2]."""
        return (self.scene.grid.length / self.scene.grid.n) ** 2

    @property
    def levels(self) -> tuple[float, float, float]:
        """Gaps [m] below which points count in AREAS."""
        adhesion = self.scene.adhesion
        share = HELD.get(adhesion.law)
        held = law_of(adhesion).contact_gap if share is None else share * adhesion.range
        return 0.0, held, self.scene.output.near_gap

    def areas_of(self, gap: np.ndarray) -> list[float]:
        """AREAS of a snapshot's gap [m]."""
        gap = gap[np.isfinite(gap)]
        return [float(np.count_nonzero(gap < level)) * self.cell for level in self.levels]

    def column(self, name: str, table: str = "curve") -> np.ndarray:
        """A column of a table of numbers, or of texts."""
        return np.asarray(getattr(self.results, table)[name])


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is not JSON")


def judge_folder(path: Path, scene, code: int, said: str) -> list[Fault]:
    """All faults of a run. scene: as resolved, None where it can't be."""
    faults = list(_of_words(said, code))
    if scene is None:
        return faults
    if not (path / "curve.csv").exists():
        if code in (0, STOPPED):
            faults.append(Fault(f"exit code {code} without a curve"))
        return faults
    folder = Folder(path, scene, code, said)
    for rule in RULES:
        try:
            faults += rule(folder)
        except Exception as error:
            one = of_exception(error)
            faults.append(Fault(f"{rule.__name__}: {one.label}", one.text))
    return faults


def _of_words(said: str, code: int) -> Iterator[Fault]:
    """What the user reads: no traceback, no warning of Python's, one message with a cure for each code but 0."""
    lines = said.splitlines()
    if "Traceback" in said:
        place = [line.strip() for line in lines if re.match(r'  File ".*/pgfmd/', line)]
        where = re.search(r'pgfmd/(\S+)", line (\d+)', place[-1]) if place else None
        where = f" at {where[1]}:{where[2]}" if where else ""
        kind = next((line for line in reversed(lines) if re.match(r"\w+(\.\w+)*(Error|Exception)\b", line)), lines[-1])
        yield Fault(f"traceback, {kind.split(':')[0]}{where}", kind[:300])
    for line in lines:
        if found := re.search(r"(\S+\.py):(\d+): (\w*Warning): (.*)", line):
            name = found[1].rpartition("pgfmd/")[2]
            yield Fault(f"{found[3]} at {name}:{found[2]}", found[4][:200])
    if code not in (0, SceneError.exit_code, RunError.exit_code, 4, STOPPED):
        yield Fault(f"exit code {code}", said[-300:])
    told = [line for line in lines if line.startswith("pgfmd: ")]
    if code not in (0, STOPPED) and "Traceback" not in said:
        if len(told) != 1:
            yield Fault(f"{len(told)} messages for exit code {code}", " | ".join(told)[:300])
        elif code == RunError.exit_code and not any(_names(dotted, told[0]) for dotted in KEYS):
            yield Fault("a failed run whose message names no key to change", told[0][:300])


def _names(dotted: str, text: str) -> bool:
    return dotted in text or f"[{dotted.rpartition('.')[0]}]" in text


def record(run: Folder) -> Iterator[Fault]:
    """The record is whole, and says how the run ended."""
    if run.code == 0 and run.record is None:
        yield Fault("exit code 0 without a record")
    if not run.finished:
        return
    found = run.record
    if found["finished"] not in (DETACHED, STOPPED_PRELOAD, STOPPED_STEPS):
        yield Fault("an end that has no name", str(found["finished"]))
    if found["finished"] != DETACHED and "stopped early" not in run.said:
        yield Fault("a run that stopped early, untold", str(found["finished"]))
    # How far off a result may be follows from the accuracy, which the scheme gfmd has not; works need an audit too.
    untold = tuple(name for name in found if name.endswith(("_uncertainty_N", "_uncertainty_J")))
    if found["scheme"] == "gfmd":
        may_lack = untold
    else:
        may_lack = () if found["viscous_J"] is not None else tuple(name for name in untold if name.endswith("_J"))
    may_lack += tuple(name for name in untold if found.get(name.replace("_uncertainty", "")) is None)
    empty = [name for name, value in found.items() if value is None and name not in (*NULLABLE, *may_lack)]
    if found["finished"] == DETACHED:
        empty += [name for name in ("pull_off_force_N", "work_of_separation_J", "preload_N") if found[name] is None]
    if empty:
        yield Fault("null in the record", ", ".join(empty))
    negative = [name for name in NEVER_NEGATIVE if (found[name] or 0.0) < -1e-12 * _scale(run, name)]
    if negative:
        yield Fault(f"negative in the record: {', '.join(negative)}", str({name: found[name] for name in negative}))


def _scale(run: Folder, name: str) -> float:
    """What rounding of an entry of the record is relative to: 1 for counts and times, else the largest energy."""
    if not name.endswith("_J") or run.results.energy is None:
        return run.largest_force if name.endswith("_N") else 1.0
    return float(max(np.abs(run.column(name, "energy")).max() for name in ("work [J]", "elastic [J]", "adhesive [J]")))


def left_overs(run: Folder) -> Iterator[Fault]:
    found = sorted(path.name for path in run.path.iterdir() if path.name.endswith(LEFT_OVERS))
    if found:
        yield Fault("left over in the folder", ", ".join(found))


def verified(run: Folder) -> Iterator[Fault]:
    """`pgfmd verify` finds nothing."""
    for part in verify(run.path):
        if not part.fine:
            yield Fault(f"verify: {part.path.name}", str(part)[:300])


def tables(run: Folder) -> Iterator[Fault]:
    """Every column holds what its declaration allows."""
    for table in TABLES:
        found = getattr(run.results, table.name)
        for fault in faults_of(table, [] if found is None else [found]):
            yield Fault(f"{table.name}: {fault.title} {fault.what}", str(fault))


def curve(run: Folder) -> Iterator[Fault]:
    """No row is there twice, phases follow each other, and indentations and areas fit the rest."""
    numbers = [entry.title for entry in CURVE.columns if entry.kind is float]
    rows = np.column_stack([run.column(title) for title in numbers])
    # A run may fail before its first row.
    if not len(rows) or not np.isfinite(rows).all():
        return
    same = (np.diff(rows[:, :4], axis=0) == 0).all(axis=1)
    if same.any():
        yield Fault("curve: equal rows", f"{same.sum()} of {len(rows)}, first row {int(np.argmax(same))}")
    if not np.array_equal(run.column("indentation [m]"), -run.column("displacement [m]")):
        yield Fault("curve: indentation is not -displacement")
    yield from _areas(run)
    phases = [name for k, name in enumerate(run.column("phase")) if k == 0 or name != run.column("phase")[k - 1]]
    if (
        phases != ["approach", "turn", "retract"][: len(phases)]
        and phases != ["approach", "turn", "dwell", "turn", "retract"][: len(phases)]
    ):
        yield Fault("curve: phases out of order", ", ".join(phases))


def _areas(run: Folder) -> Iterator[Fault]:
    """Each is a number of grid points, and the larger a level, the more of them are below it."""
    counts = {name: run.column(name) / run.cell for name in AREAS}
    for name, points in counts.items():
        whole = np.round(points)
        if (np.abs(points - whole) > 1e-6).any() or whole.min() < 0 or whole.max() > run.scene.grid.n**2:
            yield Fault("curve: an area that is no number of grid points", name)
    order = sorted(zip(run.levels, AREAS, strict=True))
    for (_, lower), (_, upper) in itertools.pairwise(order):
        if (counts[lower] > counts[upper] + 0.5).any():
            yield Fault(f"curve: more {lower.split('_')[0]} than {upper.split('_')[0]} area")
    told = (0.0, run.results.contact_gap, run.results.near_gap)
    if told != run.levels or run.results.counts_overlap:
        yield Fault("the results don't know the gaps that were counted", f"{told}, {run.levels}")


def ends(run: Folder) -> Iterator[Fault]:
    """A punch that is detached carries no force and touches nothing."""
    if not run.finished or run.record["finished"] != DETACHED:
        return
    if abs(run.force[-1]) > run.accuracy * run.largest_force + run.unbalanced:
        yield Fault("force at the end of a detached run", f"{run.force[-1]:.3g} of {run.largest_force:.3g} N")
    if run.column("contact_area [m^2]")[-1]:
        yield Fault("contact at the end of a detached run")
    # A turn that is long may be what pulls the punch off.
    if run.column("phase")[-1] not in ("turn", "retract"):
        yield Fault("a detached run that ends in the approach", str(run.column("phase")[-1]))
    asked, met = run.scene.drive.preload, run.record["preload_N"]
    if (
        met is not None
        and abs(met - asked) > PRELOAD_ERROR * asked
        and "preload" not in run.said.replace("preload  t", "")
    ):
        yield Fault("a preload that was not asked for, untold", f"{met:.6g} N for {asked:.6g} N")
    tension = run.record["pull_off_force_N"]
    late = run.column("phase") != "approach"
    most = float(max((-run.force[late]).max(initial=0.0), 0.0))
    if tension is not None and tension < most - run.accuracy * run.largest_force:
        yield Fault("a pull-off force below a tension in the curve", f"{tension:.6g} N, {most:.6g} N")


def events(run: Folder) -> Iterator[Fault]:
    """Preload, jumps and end are listed as often as they were, in order, each at a row of the curve."""
    table = run.results.events
    if table is None or not len(table):
        if run.finished:
            yield Fault("events: none")
        return
    kinds = list(run.column("event", "events"))
    rows, happened = (
        zip(*(run.column(title, table) for title in SAME_STEP), strict=True) for table in ("curve", "events")
    )
    there = set(rows)
    lost = [f"{kind} {step}" for kind, step in zip(kinds, happened, strict=True) if step not in there]
    if lost:
        yield Fault("events: one that has no row in the curve", ", ".join(lost)[:200])
    if not run.finished:
        return
    if kinds[-1] != run.record["finished"] or kinds.count("preload") != (run.record["preload_N"] is not None):
        yield Fault("events: preload or end are not those of the record", ", ".join(kinds[-3:]))
    if kinds.count("jump") != run.record["jumps"]:
        yield Fault("events: not as many jumps as the record has", f"{kinds.count('jump')}, {run.record['jumps']}")


def energies(run: Folder) -> Iterator[Fault]:
    """The audit adds up, what is lost only grows, and where the audit does not close the user is told."""
    if run.results.energy is None:
        if run.scene.output.energy:
            yield Fault("energy: no table")
        return
    columns = {name: run.column(f"{name} [J]", "energy")
               for name in ("work", "elastic", "adhesive", "viscous", "released", "residual")}  # fmt: skip
    if not len(run.time) and not len(columns["work"]):
        return
    if not np.array_equal(run.column("time [s]", "energy"), run.time):
        yield Fault("energy: other rows than the curve")
    if not all(np.isfinite(column).all() for column in columns.values()):
        return
    scale = max(float(np.abs(column).max(initial=0.0)) for name, column in columns.items() if name != "residual")
    tiny = np.finfo(float).tiny
    rest = columns["work"] - sum(columns[name] - columns[name][0] * (name in ("elastic", "adhesive")) for name in
                                 ("elastic", "adhesive", "viscous", "released")) - columns["residual"]  # fmt: skip
    if np.abs(rest).max(initial=0.0) > 10 * run.accuracy * scale + tiny:
        yield Fault("energy: columns do not add up", f"{np.abs(rest).max():.3g} of {scale:.3g} J")
    for name in ("viscous", "released"):
        fall = -np.diff(columns[name]).min(initial=0.0)
        if fall > 1e-3 * scale:
            yield Fault(f"energy: {name} falls", f"by {fall:.3g} of {scale:.3g} J")
    if not run.finished:
        return
    worst = float(np.abs(columns["residual"]).max(initial=0.0))
    # Where a run ends before the punch has worked, what the surface itself released is the scale.
    released = float(np.abs(columns["released"]).max(initial=0.0))
    stake = max(at_stake(run.results, run.record["work_J"]), LEAST_LOOP * released)
    if worst > UNBALANCED * stake and worst > LEAST_SHARE * scale and "audit" not in run.said:
        yield Fault("energy: an audit that does not close, untold", f"{worst:.3g} of {stake:.3g} J")


def snapshots(run: Folder) -> Iterator[Fault]:
    """Area, force and displacement of each snapshot are those of the curve's row of its time."""
    results = run.results
    if not results.has_fields:
        if run.finished and run.record["preload_N"] is not None:
            yield Fault("fields: none, not even of the preload")
        return
    fields = results.fields
    for k, label in enumerate(results.labels):
        time = float(np.asarray(fields["time"][k]))
        gap, traction = results.frame("gap", k), results.frame("traction", k)
        inside = np.isfinite(gap)
        if not inside.any() or not np.isfinite(traction[inside]).all():
            yield Fault("fields: not finite", label)
            continue
        force, areas = -float(traction[inside].sum()) * run.cell, run.areas_of(gap)
        rows = np.flatnonzero(run.time == time)
        if not len(rows):
            if run.scene.output.every == 1:
                yield Fault("fields: a snapshot that has no row in the curve", f"{label}, t = {time!r} s")
            continue
        pulls = float(np.abs(traction[inside]).sum()) * run.cell
        row, rounding = rows[-1], run.accuracy * max(pulls, run.largest_force)
        rows = rows[np.abs(run.force[rows] - force) <= 100 * rounding + run.unbalanced]
        if not len(rows):
            yield Fault("fields: a force that is not the curve's", f"{label}: {force:.9g} N, {run.force[row]:.9g} N")
            continue
        counted = np.column_stack([run.column(name)[rows] for name in AREAS])
        if not np.isclose(counted, areas, rtol=1e-6, atol=0.0).all(axis=1).any():
            yield Fault("fields: areas that are not the curve's", f"{label}: {areas}, {counted[-1]} m^2")
        place, depth = float(np.asarray(fields["punch_position"][k])), run.column("displacement [m]")[rows]
        if np.abs(depth - place).min() > 1e-12 * np.abs(run.column("displacement [m]")).max():
            yield Fault("fields: a displacement that is not the curve's", f"{label}: {place!r}, {depth!r}")


def patches(run: Folder) -> Iterator[Fault]:
    """The patches of a snapshot have its contact area; sites join and leave in turn, and are counted right."""
    table, results = run.results.patches, run.results
    if table is not None and results.has_fields:
        numbers, areas = run.column("snapshot", "patches"), run.column("area [m^2]", "patches")
        for k, label in enumerate(results.labels):
            _, area, _ = run.areas_of(results.frame("gap", k))
            if not math.isclose(areas[numbers == k].sum(), area, rel_tol=1e-9, abs_tol=1e-9 * run.cell):
                yield Fault(
                    "patches: not the contact of the snapshot",
                    f"{label}: {areas[numbers == k].sum():.6g}, {area:.6g} m^2",
                )
    if run.results.sites is not None:
        yield from _sites(run)


def _sites(run: Folder) -> Iterator[Fault]:
    held: dict[str, set] = {}
    columns = zip(
        *(run.column(name, "sites") for name in ("kind", "site", "event", "in_contact", "of", "time [s]")), strict=True
    )
    last = -math.inf
    for kind, site, event, count, of, time in columns:
        now = held.setdefault(kind, set())
        if (event == "joins") == (site in now):
            yield Fault(
                "sites: one joins that is there, or leaves that is not", f"{kind} {site} {event}, t = {time:.6g} s"
            )
            return
        now ^= {site}
        if len(now) > of or time < last or (count != len(now) and time != last):
            yield Fault(
                "sites: counted wrong, or time goes back", f"{kind} {site} {event}, {count} of {of}, t = {time:.6g} s"
            )
            return
        last = time
    if run.finished and run.record["finished"] == DETACHED and any(held.values()):
        yield Fault(
            "sites: in contact at the end of a detached run", str({kind: len(now) for kind, now in held.items()})
        )


def analysed(run: Folder) -> Iterator[Fault]:
    """`pgfmd analyse` reads a finished run."""
    if run.finished:
        from pgfmd.analysis.summary import analyse

        try:
            analyse(run.path)
        except PgfmdError as error:
            if run.record["finished"] == DETACHED:
                yield Fault("analyse refuses a finished run", str(error)[:300])


RULES: tuple[Callable[[Folder], Iterator[Fault]], ...] = (
    record, left_overs, verified, tables, curve, ends, events, energies, snapshots, patches, analysed,
)  # fmt: skip
