"""Tables of the model of more ranks (pgfmd/forecast/scaling.py), for scripts/studies/ranks/run.py: what was measured here, and what the
model makes of it on machines that are larger."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace

import numpy as np

from pgfmd.benchmark import ranks as bench
from pgfmd.forecast.scaling import (
    PARTS,
    SUMS,
    Costs,
    Network,
    Problem,
    pair_seconds,
    total_seconds,
    traffic_of_pair,
    traffic_of_sum,
)  # fmt: skip
from pgfmd.host.processes import load

LARGE, CORES = (4096, 8192, 16384, 32768), (16, 64, 256, 1024, 4096)
"""Grids and numbers of ranks that the model is printed for."""
CASES = ((4096, 64), (8192, 256), (16384, 1024), (32768, 1024), (32768, 4096))
"""Grids and numbers of ranks whose time is taken apart."""
SHARED_BY = (2, 3, 4, 8, 16, 32, 64, 256)
"""Ranks among which the rows of a round punch are shared out."""
ROW_WORK = 0.6
"""Work on a row beside that on its points, in rows as wide as the punch: what wins most, and near what is measured."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `model`."""
    parser.add_argument("--per-node", type=int, default=64, help="ranks on a node of the model (default: %(default)s)")
    parser.add_argument(
        "--latency", type=float, default=1.5, metavar="US", help="of a message between nodes (default: %(default)s us)"
    )
    parser.add_argument(
        "--message",
        type=float,
        default=0.3,
        metavar="US",
        help="a rank's own time for a message (default: %(default)s us)",
    )
    parser.add_argument(
        "--bandwidth", type=float, default=12.0, metavar="GB/S", help="of a node (default: %(default)s GB/s)"
    )
    parser.add_argument(
        "--look",
        type=float,
        default=0.1,
        metavar="US",
        help="of a synchronisation, for each further rank of a node (default: %(default)s us)",
    )
    parser.add_argument(
        "--crowding",
        type=float,
        default=None,
        help="slowdown of work on a full node; default: as with the most ranks measured",
    )


def blocks(options: argparse.Namespace) -> dict[str, str]:
    """All tables by name, from measurements that are made now."""
    counts = sorted(set(options.ranks) | {1})
    profile, records = bench.survey(options.n, counts, lambda line: print(line, flush=True))
    model = Model(profile.costs, options)
    return {
        "measured": "\n\n".join((_costs(profile), _fit(records, profile))),
        "traffic": _traffic(options.n, model),
        "large": "\n\n".join((_assumptions(options, model), _times(model), _next(model))),
        "parts": _parts(model),
        "balance": _balance(model),
        "overlap": _overlap(model),
    }


class Model:
    """What the model needs for large machines: what a run of a size shares out, and its costs there.

    costs: as measured, by kind. `changes`: of the scene, none by default: then runs choose what they step, and in which
    precision. `network`, `per_node`: as assumed.
    """

    def __init__(self, costs: dict[str, Costs], options: argparse.Namespace):
        self.here, self.options, self.changes, self.per_node = costs, options, options.set, options.per_node
        self.network = Network(1e-6 * options.latency, 1e-6 * options.message, 1e9 * options.bandwidth)

    def problem(self, n: int) -> Problem:
        return bench.usual(n, self.changes)

    def costs(self, problem: Problem) -> Costs:
        found = replace(self.here[problem.kind], look=1e-6 * self.options.look)
        if not self.options.crowding:
            return found
        return replace(found, crowding=(1.0,) + (self.options.crowding,) * (self.per_node - 1))

    def of(self, problem: Problem, ranks: int) -> tuple[Problem, int, Costs, int, Network]:
        """What the model's functions take."""
        return problem, ranks, self.costs(problem), self.per_node, self.network

    @property
    def stepped(self) -> str:
        """What is stepped of large scenes, in words."""
        why = f" ({', '.join(self.changes)})" if self.changes else ", as runs choose"
        return f"{self.problem(LARGE[0]).kind} points{why}"


def table(head: list[str], rows: list[list[object]]) -> str:
    """Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def shown(value: float, digits: int = 3) -> str:
    """So many digits, without powers of ten."""
    if value == 0.0:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}"


def _costs(profile) -> str:
    rows = [
        [kind, n, shown(1e6 * costs.row[i]), shown(1e6 * costs.column[i]), shown(1e9 * costs.point[i])]
        for kind, costs in profile.costs.items() for i, n in enumerate(costs.sizes)
    ]  # fmt: skip
    overheads = [
        [
            kind, shown(1e6 * costs.pair_overhead), shown(1e6 * costs.sum_overhead), shown(1e9 * costs.shared),
            ", ".join(f"{factor:.2f}" for factor in costs.crowding),
        ]
        for kind, costs in profile.costs.items()
    ]  # fmt: skip
    any_kind = next(iter(profile.costs.values()))
    rest = (
        f"Further costs: {shown(1e9 * any_kind.adding)} ns for each row and sum, "
        f"{shown(1e6 * any_kind.meeting)} µs for a synchronisation of two ranks. A run starts in "
        f"{', '.join(f'{s:.2g} s on {k}' for k, s in profile.start.items())}. The next table has the work "
        "that every rank does itself, the access to a byte in the memory of another rank, and the slowdown of ranks that work at the same time:"
    )
    return "\n\n".join((
        table(["points", "n", "row, forward and back (µs)", "column, forward and back (µs)", "point, per sum (ns)"], rows), rest,
        table(["points", "pair (µs)", "sum (µs)", "byte (ns)", "slowdown on 1, 2, ... ranks"], overheads),
    ))  # fmt: skip


def _fit(records: list[dict], profile) -> str:
    rows = []
    for record in sorted(
        records, key=lambda record: (record["precision"], record["n"], record["mirror"], record["ranks"])
    ):
        # What is measured on several ranks, too.
        if record["n"] == bench.TINY or bench.WITNESSES[record["precision"]] != record["mirror"]:
            continue
        problem = bench.forced(record["n"], record["precision"], record["mirror"])
        expected = total_seconds(problem, record["ranks"], profile.costs[problem.kind], sums=record["sums"])
        model = f"{1e3 * expected:.3g}" if record["ranks"] <= profile.cores else f"({1e3 * expected:.3g})"
        rows.append(
            [problem.kind, record["n"], record["ranks"], f"{record['sums']:.2f}", f"{1e3 * record['pair']:.3g}", model]
        )
    text = table(["points", "n", "ranks", "sums per pair", "measured (ms)", "model (ms)"], rows)
    if any(record["ranks"] > profile.cores for record in records):
        text += f"\n\nIn brackets: more ranks than the {profile.cores} cores of this machine, which the model does not describe."
    return text


def _traffic(sizes: list[int], model: Model) -> str:
    """Counts for the first rank of 1, 2, 3 ranks, and of 4 in two nodes."""
    rows = []
    for n in sizes:
        problem = model.problem(n)
        for nodes in ([0], [0, 0], [0, 0, 0], [0, 0, 1, 1], [0, 1, 2]):
            pair, one = traffic_of_pair(problem, nodes, 0), traffic_of_sum(nodes, 0)
            rows.append([
                problem.kind, n, len(nodes), len(set(nodes)), shown(1e-6 * pair.shared), shown(1e-6 * pair.sent), pair.messages,
                pair.meetings, one.meetings, one.gathers,
            ])  # fmt: skip
    head = [
        "points", "n", "ranks", "nodes", "in shared memory (MB)", "in messages (MB)", "messages", "synchronisations",
        "synchronisations per sum",
        "gathers per sum",
    ]  # fmt: skip
    return table(head, rows)


def _assumptions(options: argparse.Namespace, model: Model) -> str:
    crowding = (
        f"taken to be {options.crowding:g} times as long"
        if options.crowding
        else "taken to be as measured with the most ranks"
    )
    return (
        f"For {model.stepped}. Assumed, not measured: {options.per_node} ranks per node; {options.latency:g} µs for a message between nodes, "
        f"{options.message:g} µs of a rank's own time for each, {options.bandwidth:g} GB/s per node; {options.look:g} µs more for a synchronisation "
        f"with each further rank of a node; work on a full node is {crowding}; {SUMS:g} sums per pair. Transforms longer than those measured cost as "
        "n log n."
    )


def _times(model: Model) -> str:
    rows = []
    for n in LARGE:
        problem = model.problem(n)
        alone = total_seconds(problem, 1, model.costs(problem))
        cells = [n, f"{problem.rows}, {problem.columns}", shown(1e3 * alone)]
        for cores in CORES:
            if cores > problem.most_ranks:
                cells.append("too many")
                continue
            taken = total_seconds(*model.of(problem, cores))
            cells.append(f"{shown(1e3 * taken)} ({alone / taken / cores:.0%})")
        rows.append(cells)
    head = ["n", "rows, columns", "1 core", *(f"{cores} cores" for cores in CORES)]
    return "Time of a pair with everything that belongs to it, in ms (and speed-up per core):\n\n" + table(head, rows)


def _next(model: Model) -> str:
    rows = []
    for n in LARGE:
        problem = model.problem(n)
        for cores in CORES[-3:]:
            given = model.of(problem, cores)
            slabs = total_seconds(*given) if cores <= problem.most_ranks else None
            joined = sum(joined_seconds(*given).values()) if slabs else None
            down, across = blocks_of(cores)
            pencils = sum(pencil_seconds(*given).values())
            cells = [shown(1e3 * value) if value else "too many ranks" for value in (slabs, joined, pencils)]
            rows.append([n, cores, *cells, f"{down} x {across}"])
    head = [
        "n",
        "cores",
        "slabs, as implemented (ms)",
        "slabs, one message per pair of nodes (ms)",
        "blocks (ms)",
        "blocks",
    ]
    return "Possible improvements:\n\n" + table(head, rows)


def joined_seconds(problem: Problem, ranks: int, costs: Costs, per_node: int, network: Network) -> dict[str, float]:
    """Parts of a pair if what the ranks of a node have for another node went in one message: their blocks lie in shared
    memory anyway. Each rank sends for its part of the other nodes, after one more meeting each way."""
    parts = pair_seconds(problem, ranks, costs, per_node, network)
    others = -(-ranks // per_node) - 1
    if others:
        messages = 2 * -(-others // per_node)
        parts["latency"] = messages * network.message + 2.0 * network.latency
        parts["shared memory"] += 2.0 * (costs.meeting + (per_node - 2) * costs.look)
    return parts


def blocks_of(ranks: int) -> tuple[int, int]:
    """(down, across): the most nearly square split of the ranks."""
    across = max(size for size in range(1, math.isqrt(ranks) + 1) if ranks % size == 0)
    return ranks // across, across


def pencil_seconds(problem: Problem, ranks: int, costs: Costs, per_node: int, network: Network) -> dict[str, float]:
    """Parts of a pair if the plane were shared out in blocks, and single transforms over the ranks of a row or column of
    blocks.

    A transform of n = n1 n2 points over several ranks has one exchange within them between its two halves (Gentleman and
    Sande, AFIPS 29, 563, 1966). So a pair has four: two of the rows by the columns, and two of the columns in their whole
    length, as they are filled up with zeros before. Work as that of slabs without a rank that has more of it.
    """
    costs_of_all = pair_seconds(problem, 1, costs)
    down, across = blocks_of(ranks)
    parts = {name: costs.crowd(per_node) * costs_of_all[name] / ranks for name in ("rows", "columns", "pointwise")}
    parts["overhead"] = costs_of_all["overhead"]
    parts["sums"] = pair_seconds(problem, min(ranks, problem.most_ranks), costs, per_node, network)["sums"]
    # Ranks of a row of blocks are on one node where it has so many.
    inside = min(1.0, per_node / across)
    of_rows, of_columns = (
        problem.itemsize * count * problem.columns / ranks for count in (problem.rows, problem.length)
    )
    sent = 2.0 * of_rows * (1.0 - inside) + 2.0 * of_columns * (1.0 - 1.0 / down)
    messages = 2 * (across - 1) * (inside < 1.0) + 2 * (down - 1)
    if ranks <= per_node:
        sent, messages = 0.0, 0
    parts["shared memory"] = 2.0 * of_rows * inside * costs.shared + 4.0 * (costs.meeting + (per_node - 2) * costs.look)
    parts["latency"] = messages * network.message + 4.0 * network.latency
    parts["bandwidth"] = sent * min(per_node, ranks) / network.bandwidth
    return parts


def _parts(model: Model) -> str:
    rows = []
    for n, cores in CASES:
        parts = pair_seconds(*model.of(model.problem(n), cores))
        total = sum(parts.values())
        rows.append([n, cores, shown(1e3 * total), *(f"{100 * parts[name] / total:.1f}" for name in PARTS)])
    return "Where the time goes, in percent:\n\n" + table(["n", "cores", "ms", *PARTS], rows)


def _by(problem: Problem, ranks: int, row: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shares of ranks among which rows are shared out by their points and, beside them, `row` of those of the longest; pairs
    of rows are not torn apart."""
    together = 2 if problem.mirror else 1
    places = np.append(np.arange(0, problem.rows, together), problem.rows)
    work = problem.ends[places] + row * np.diff(problem.ends).max() * places
    edges = places[
        np.rint(np.interp(np.arange(ranks + 1) / ranks * work[-1], work, np.arange(places.size))).astype(int)
    ]
    return np.diff(edges), problem.shares(ranks)[1], np.diff(problem.ends[edges])


def _balance(model: Model) -> str:
    rows = []
    for n, ranks in ((n, ranks) for n in (1024, 4096) for ranks in SHARED_BY):
        problem = model.problem(n)
        if ranks > problem.most_ranks:
            continue
        shares = {
            "rows": problem.shares(ranks),
            "points": _by(problem, ranks, 0.0),
            "work": _by(problem, ranks, ROW_WORK),
        }
        seconds = {by: sum(pair_seconds(*model.of(problem, ranks), found).values()) for by, found in shares.items()}
        fair = problem.rows / ranks, problem.ends[-1] / ranks
        cells = [f"{found[0].max() / fair[0]:.2f}, {found[2].max() / fair[1]:.2f}" for found in shares.values()]
        gains = [f"{100 * (1 - seconds[by] / seconds['rows']):.1f} %" for by in ("points", "work")]
        rows.append([n, ranks, *cells, *gains])
    return table(["n", "ranks", "by rows", "by points", "by work", "gain by points", "gain by work"], rows)


def _overlap(model: Model) -> str:
    """What could be hidden behind work, at most: bytes and messages of the transposes, not the waits for the slowest."""
    rows = []
    for n, ranks in (*((n, 2) for n in (512, 1024, 2048)), *CASES):
        problem = model.problem(n)
        given = model.of(problem, ranks) if n > 2048 else (problem, ranks, model.here[problem.kind])
        parts = pair_seconds(*given)
        total = sum(parts.values())
        moved = {name: 100 * parts[name] / total for name in ("shared memory", "latency", "bandwidth")}
        # A batch of rows or columns can be worked on while the last is on its way: both take as long as the longer.
        hidden = min(parts["rows"] + parts["columns"], parts["bandwidth"])
        rows.append([n, ranks, *(f"{value:.1f}" for value in moved.values()), f"{100 * hidden / total:.1f}"])
    head = ["n", "ranks", "shared memory (%)", "latency (%)", "bandwidth (%)", "could be hidden, at most (%)"]
    return table(head, rows)


def busy() -> str:
    """A note on other load of the machine; empty if it is idle."""
    found = load()
    what = "when this was measured: these numbers are provisional."
    return f"The machine was busy (load {found:.1f}) {what}" if found else ""
