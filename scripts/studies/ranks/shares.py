"""Where the time of a whole run goes on 1 and 2 ranks: for scripts/studies/ranks/run.py, which starts this on some ranks.

python -m scripts.studies.ranks.shares SECONDS tri-tack grid.n=1024        prints JSON from rank 0; SECONDS: when it was started
"""

from __future__ import annotations

import json
import sys
import tempfile
import time

PARTS = (
    "start: launch and imports", "start: kernels", "start: fields and plans", "transforms of columns", "transforms of rows",
    "waits in transposes", "waits for sums", "curve, snapshots, checkpoints", "pointwise and the rest", "end",
)  # fmt: skip


def main() -> None:
    began, scene = float(sys.argv[1]), sys.argv[2:]
    from pgfmd.host import launch

    comm = launch.world()
    with launch.guarded(comm), tempfile.TemporaryDirectory(prefix="pgfmd-shares-") as folder:
        found = profile(comm, scene, comm.bcast(folder), began)
        everywhere = comm.gather(found)
        if comm.rank == 0:
            print(json.dumps(everywhere))


def profile(comm, scene: list[str], folder: str, began: float) -> dict[str, float]:
    """Seconds of this rank's run, by PARTS, and its counts. Collective."""
    from pgfmd import runner
    from pgfmd.benchmark.timing import Watch
    from pgfmd.restart.checkpoint_policy import CheckpointPolicy
    from pgfmd.scene import load_scene
    from pgfmd.solver.simulation import Simulation

    loaded, spent = load_scene(scene[0], scene[1:]), dict.fromkeys(PARTS, 0.0)
    # A run's own imports come with its command.
    ready = time.time()
    spent["start: launch and imports"] = ready - began
    watches: list[Watch] = []

    def timed(owner, name: str, part: str, then=lambda found: None) -> None:
        original = getattr(owner, name)

        def action(*given):
            start = time.perf_counter()
            found = original(*given)
            spent[part] += time.perf_counter() - start
            then(found)
            return found

        setattr(owner, name, action)

    timed(runner, "compile_kernels", "start: kernels")
    timed(runner, "assemble", "start: fields and plans", lambda found: watches.append(Watch(found, time.perf_counter)))
    timed(Simulation, "_note", "curve, snapshots, checkpoints")
    timed(CheckpointPolicy, "attend", "curve, snapshots, checkpoints")
    marks: dict[str, float] = {}
    original = Simulation.run

    def steps(self, **given):
        marks["before"], marks["at"] = watches[-1].now().get("waited", 0.0), time.perf_counter()
        found = original(self, **given)
        marks["steps"] = time.perf_counter() - marks["at"]
        return found

    Simulation.run = steps
    start = time.perf_counter()
    runner.run_scene(loaded, comm, folder, say=lambda line: None)
    whole, watch = time.perf_counter() - start, watches[-1]
    calls, now = watch.calls, watch.now()
    spent["transforms of columns"] = sum(calls["_convolve_columns"])
    spent["transforms of rows"] = sum(calls["_rows_forward"]) + sum(calls["_rows_backward"])
    spent["waits in transposes"] = watch.outside
    spent["waits for sums"] = (
        max(0.0, now.get("waited", 0.0) - marks["before"] - watch.outside) if comm.size > 1 else 0.0
    )
    inside = (
        "transforms of columns",
        "transforms of rows",
        "waits in transposes",
        "waits for sums",
        "curve, snapshots, checkpoints",
    )
    spent["pointwise and the rest"] = marks["steps"] - sum(spent[part] for part in inside)
    spent["end"] = whole - marks["steps"] - spent["start: kernels"] - spent["start: fields and plans"]
    pairs = now["pairs"]
    counts = {
        "pairs": pairs,
        "sums per pair": now["sums"] / pairs,
        "synchronisations per pair": now.get("meetings", 0) / pairs,
    }
    return spent | {"whole": ready - began + whole} | counts


if __name__ == "__main__":
    main()
