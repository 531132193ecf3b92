"""Kills runs with -9 at random times, resumes them until they are finished, and compares what they leave.

    source scripts/environment
    python -m scripts.studies.restart.torture --kills 200

A run that nobody disturbs comes first. Then the same run in other folders, with a checkpoint every twentieth of a
second: a random rank, or mpirun itself, is killed at a random time (from the very start on), or as soon as a checkpoint
is being written. The same command goes on, and is killed again, until a run gets to its end; its tables, snapshots and
last state must then have the bits of the undisturbed one. After each kill all processes must be gone within seconds, and
a valid checkpoint must be there, if there was one before. One line a fault, and a summary; exit code 1 if anything went
wrong.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

os.environ.setdefault("OMPI_ALLOW_RUN_AS_ROOT", "1")
os.environ.setdefault("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
os.environ.setdefault("OMPI_MCA_rmaps_base_oversubscribe", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from pgfmd.files.storage import CHECKPOINT_FILE, CHECKPOINT_FILES, CURVE_FILE, RUN_FILE
from pgfmd.restart.checkpoint_layout import Damaged, examine
from pgfmd.restart.sameness import differences

SCENE = ("tri-tack", "grid.n=48", "solver.accuracy=1e-3", "drive.preload=10 mN",
         'output.snapshots=["2 s", "4 s", "1.1 t_pl"]')  # fmt: skip
"""About 2000 steps: some seconds on one core."""
GONE_WITHIN, FINISHED_WITHIN = 10.0, 180.0
"""Seconds in which a killed job must have ended, and an undisturbed one must be finished."""
IN_A_WRITE, ANY_TIME = 0.4, 0.25
"""Shares of the kills that wait for a checkpoint being written, and that may come at any time after the start; the others
come when the run has gone on."""


@dataclass
class Tally:
    """What has happened so far."""

    kills: int = 0
    in_writes: int = 0
    runs: int = 0
    wrong: list[str] = field(default_factory=list)
    kinds: Counter = field(default_factory=Counter)


class Job:
    """One mpirun of the scene into a folder."""

    def __init__(self, folder: Path, ranks: int, scene: tuple[str, ...], every: str):
        command = ["mpirun", "-n", str(ranks), sys.executable, "-m", "pgfmd.cli", "run", *scene, "--out", str(folder),
                   "--checkpoint-every", every]  # fmt: skip
        self.log = tempfile.TemporaryFile(mode="w+")  # noqa: SIM115 - it lives as long as the job
        self.process = subprocess.Popen(command, stdout=self.log, stderr=subprocess.STDOUT, start_new_session=True)

    def pids(self) -> list[int]:
        """The ranks' processes: mpirun's children."""
        path = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        try:
            return [int(pid) for pid in path.read_text().split()]
        except OSError:
            return []

    def output(self) -> str:
        """What the job has said."""
        self.log.seek(0)
        return self.log.read()


def alive(pid: int) -> bool:
    """Whether a process runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def valid_checkpoint(folder: Path) -> tuple[bool, str]:
    """Whether one of the two checkpoints is valid, and the step that it is of."""
    told = []
    for name in CHECKPOINT_FILES:
        try:
            head = examine(folder / name)
            return True, f"{name.removesuffix('.h5')} of step {head['state']['counters']['steps']}"
        except FileNotFoundError:
            continue
        except Damaged as damage:
            told.append(f"{name}: {damage}")
    return False, "; ".join(told) or "no checkpoint"


def wait_for_moment(job: Job, folder: Path, chance: random.Random) -> str:
    """Waits until it is time to kill; returns the kind of moment, empty if the job has ended by itself."""
    draw, began = chance.random(), time.monotonic()
    kind = "in a write" if draw < IN_A_WRITE else "any time" if draw < IN_A_WRITE + ANY_TIME else "running"
    curve, unfinished = folder / CURVE_FILE, folder / (CHECKPOINT_FILE + ".tmp")
    size = curve.stat().st_size if curve.exists() else 0
    wait = chance.uniform(0.0, 4.0 if kind == "any time" else 1.0)
    while job.process.poll() is None:
        now = time.monotonic()
        if now - began > FINISHED_WITHIN:
            return "hung"
        if kind == "any time":
            if now - began > wait:
                return kind
        elif not curve.exists() or curve.stat().st_size == size:
            began = now
        elif kind == "running":
            if now - began > wait:
                return kind
        elif unfinished.exists():
            # A moment later, so that kills fall all over a write.
            time.sleep(chance.uniform(0.0, 0.01))
            return kind
        time.sleep(0.0005 if kind == "in a write" else 0.005)
    return ""


def strike(job: Job, folder: Path, chance: random.Random, kind: str, tally: Tally) -> None:
    """Kills a rank or mpirun, and looks at what is left."""
    had = any((folder / name).exists() for name in CHECKPOINT_FILES)
    ranks = job.pids()
    victims = {job.process.pid: "mpirun"} | {pid: f"rank {k}" for k, pid in enumerate(ranks)}
    victim = chance.choice(list(victims))
    os.kill(victim, signal.SIGKILL)
    struck = time.monotonic()
    in_write = (folder / (CHECKPOINT_FILE + ".tmp")).exists()
    while time.monotonic() - struck < GONE_WITHIN and any(alive(pid) for pid in (job.process.pid, *ranks)):
        job.process.poll()
        time.sleep(0.01)
    took = time.monotonic() - struck
    job.process.poll()
    left = [victims[pid] for pid in victims if alive(pid)]
    if left:
        tally.wrong.append(f"kill {tally.kills + 1}: {', '.join(left)} lived on for {GONE_WITHIN:g} s")
        os.killpg(job.process.pid, signal.SIGKILL)
    valid, what = valid_checkpoint(folder)
    if had and not valid:
        tally.wrong.append(f"kill {tally.kills + 1}: no valid checkpoint: {what}")
    tally.kills += 1
    tally.in_writes += in_write
    tally.kinds[victims[victim] if victims[victim] == "mpirun" else "rank"] += 1
    print(
        f"{tally.kills:4d}  {victims[victim]:7s} killed, {kind}{' (file open)' if in_write else '':12s}  gone in {took:.2f} s"
        f"  {what}",
        flush=True,
    )


def undisturbed(folder: Path, arguments: argparse.Namespace) -> float:
    """A run that nobody kills; returns the time [s] that it took."""
    began = time.monotonic()
    job = Job(folder, arguments.ranks, tuple(arguments.scene), "off")
    if job.process.wait(timeout=FINISHED_WITHIN) != 0:
        raise SystemExit(f"the undisturbed run failed:\n{job.output()}")
    return time.monotonic() - began


def torture(work: Path, arguments: argparse.Namespace) -> Tally:
    """Runs and kills until there were enough kills; the last run is let go to its end."""
    chance, tally, whole = random.Random(arguments.seed), Tally(), work / "undisturbed"
    took = undisturbed(whole, arguments)
    print(f"undisturbed: {took:.1f} s on {arguments.ranks} ranks", flush=True)
    while tally.kills < arguments.kills or tally.runs == 0:
        folder, kills = work / "killed", tally.kills
        shutil.rmtree(folder, ignore_errors=True)
        while not (folder / RUN_FILE).exists():
            job = Job(folder, arguments.ranks, tuple(arguments.scene), arguments.every)
            kind = wait_for_moment(job, folder, chance) if tally.kills < arguments.kills else ""
            if kind == "hung":
                tally.wrong.append(f"after kill {tally.kills}: not finished in {FINISHED_WITHIN:g} s\n{job.output()}")
                os.killpg(job.process.pid, signal.SIGKILL)
                return tally
            if kind:
                strike(job, folder, chance, kind, tally)
            elif job.process.wait(timeout=FINISHED_WITHIN) != 0:
                tally.wrong.append(f"after kill {tally.kills}: exit code {job.process.returncode}\n{job.output()}")
                return tally
        tally.runs += 1
        different = differences(whole, folder)
        tally.wrong += [f"run {tally.runs}: {name} differs" for name in different]
        print(f"run {tally.runs} finished after {tally.kills - kills} kills: "
              f"{'other bits: ' + ', '.join(different) if different else 'the same bits'}", flush=True)  # fmt: skip
    return tally


def main() -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--every", default="0.05s", help="time between checkpoints")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scene", nargs="+", default=list(SCENE), help="a scene and its changes")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="pgfmd-torture-") as work:
        tally = torture(Path(work), arguments)
    for line in tally.wrong:
        print(f"WRONG: {line}")
    print(
        f"{tally.kills} kills ({tally.kinds['rank']} of ranks, {tally.kinds['mpirun']} of mpirun, {tally.in_writes} while a "
        f"checkpoint was being written) in {tally.runs} runs: {len(tally.wrong)} faults"
    )
    return 1 if tally.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
