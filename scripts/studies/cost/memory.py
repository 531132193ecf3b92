"""How much memory runs take, all ranks together, and what `pgfmd check` says beforehand.

    python -m scripts.studies.cost.memory [--scene tri-tack hex-tack] [--n 4096] [--ranks 2] [--set KEY=VALUE]

Runs whole tests with the defaults of each scene, audit, snapshots, patches and checkpoints, but with a preload so small that they
take few steps: memory does not grow with these. The ranks' memory is read from the system again and again (Linux: `smaps_rollup`
and `status`). Pages that ranks share are counted once: those of windows by their share, those of program files, which are the same
for all, on the rank that has most of them. Prints a table of the most memory at any time; `--trace` prints it in the course of time as well.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from pgfmd.forecast.estimate import memory_of
from pgfmd.scene import load_scene

PERIOD = 0.1
"""Time [s] between two looks."""
SHORT = ("drive.preload=1 uN", "drive.speed=25 um/s")
"""What makes a test short: some 40 steps."""


@dataclass
class Sample:
    """Memory [bytes] of all ranks: in all, and its parts: of their own, in shared windows, of files."""

    total: int = 0
    own: int = 0
    windows: int = 0
    files: int = 0


def sample(processes: list[int]) -> Sample:
    """What these processes take now; those that are gone take nothing."""
    found = Sample()
    for process in processes:
        try:
            rolled, status = _kilobytes(process, "smaps_rollup"), _kilobytes(process, "status")
        except OSError:
            continue
        found.own += 1024 * rolled.get("Pss_Anon", 0)
        found.windows += 1024 * rolled.get("Pss_Shmem", 0)
        found.files = max(found.files, 1024 * status.get("RssFile", 0))
    found.total = found.own + found.windows + found.files
    return found


def _kilobytes(process: int, name: str) -> dict[str, int]:
    """The numbers with the unit kB in a file of a process."""
    lines = (line.split() for line in Path(f"/proc/{process}/{name}").read_text().splitlines())
    return {words[0].rstrip(":"): int(words[1]) for words in lines if words[-1:] == ["kB"]}


def descendants(process: int) -> list[int]:
    """The Python processes below this one, and itself if it is one."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, ValueError):
                continue
    found = [process]
    for parent in found:
        found += [child for child, above in parents.items() if above == parent]
    return [one for one in found if _is_python(one)]


def _is_python(process: int) -> bool:
    try:
        return "python" in Path(f"/proc/{process}/exe").resolve().name
    except OSError:
        return False


def measure(scene: str, changes: list[str], ranks: int, trace: bool) -> Sample:
    """The most memory of a run at any time."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pgfmd", "run", scene, "--out", folder]
        for change in changes:
            command += ["--set", change]
        launch = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        most, began = Sample(), time.monotonic()
        with open(Path(folder, "said"), "w") as said:
            run = subprocess.Popen([*launch, *command], stdout=said, stderr=said)
            while run.poll() is None:
                now = sample(descendants(run.pid))
                if trace:
                    parts = " ".join(f"{value / 1e6:7.0f}" for value in (now.total, now.own, now.windows, now.files))
                    print(f"{time.monotonic() - began:7.1f} s {parts} MB", flush=True)
                most = max(most, now, key=lambda one: one.total)
                time.sleep(PERIOD)
        if run.returncode not in (0, 3):
            raise SystemExit(Path(folder, "said").read_text())
    return most


def main() -> None:
    """The table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scene", nargs="+", default=["tri-tack", "hex-tack"])
    options.add_argument("--n", type=int, nargs="+", default=[1024, 2048, 4096])
    options.add_argument("--ranks", type=int, nargs="+", default=[2])
    options.add_argument("--set", action="append", default=[])
    options.add_argument("--trace", action="store_true")
    chosen = options.parse_args()
    print("| scene | n | ranks | memory | private | in shared windows | files | forecast | forecast / measured |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for scene in chosen.scene:
        for n in chosen.n:
            for ranks in chosen.ranks:
                changes = [f"grid.n={n}", *SHORT, *chosen.set]
                forecast = memory_of(load_scene(scene, changes), ranks).in_all(ranks)
                most = measure(scene, changes, ranks, chosen.trace)
                parts = " | ".join(
                    f"{value / 1e6:.0f} MB" for value in (most.total, most.own, most.windows, most.files)
                )
                print(
                    f"| {scene} | {n} | {ranks} | {parts} | {forecast / 1e6:.0f} MB | {forecast / most.total:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
