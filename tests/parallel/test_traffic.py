"""What ranks pass to each other is what the model of more ranks counts."""

import numpy as np
import pytest

pytest.importorskip("mpi4py")
from mpi4py import MPI

from pgfmd.forecast.scaling import Problem, traffic_of_pair, traffic_of_sum
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.mirrored_transform import MirroredConvolution
from pgfmd.solver.multiplier import periodic_multiplier
from pgfmd.solver.node import Node
from pgfmd.solver.transform import Convolution

pytestmark = pytest.mark.mpi

SPLITS = {
    "one node": lambda rank: 0,
    "each alone": lambda rank: rank,
    "first and rest": lambda rank: min(rank, 1),
    "odd and even": lambda rank: rank % 2,
}


def passed(node, action):
    """What a rank has passed to others within an action: messages, sent, meetings, gathers."""
    names = ("messages", "sent", "meetings", "gathers")
    before = [getattr(node, name) for name in names]
    action()
    return {name: getattr(node, name) - old for name, old in zip(names, before, strict=True)}


def counted(traffic):
    return {name: getattr(traffic, name) for name in ("messages", "sent", "meetings", "gathers")}


@pytest.mark.parametrize("split", SPLITS)
@pytest.mark.parametrize(
    ("n", "dtype", "mirror"),
    [
        (40, np.float64, ""), (23, np.float64, ""), (40, np.float32, ""),
        (40, np.float64, "x"), (42, np.float32, "x"), (40, np.float64, "xy"), (46, np.float32, "xy"),
    ],
)  # fmt: skip
def test_a_pair_and_a_sum_pass_what_the_model_counts(split, n, dtype, mirror):
    comm = MPI.COMM_WORLD.Dup()
    node = Node.arrange(comm, SPLITS[split](comm.rank))
    nodes = [SPLITS[split](rank) for rank in range(comm.size)]
    points = PunchPoints(Grid(n, 1.0), 0.3, comm, mirror=mirror)
    kind = MirroredConvolution if mirror else Convolution
    convolve = kind(points, n, periodic_multiplier(lambda qx, qy: 1.0 / (1.0 + qx**2 + qy**2), 1.0), dtype=dtype)
    precision = "double" if dtype is np.float64 else "single"
    problem = Problem.of(PunchPoints(Grid(n, 1.0), 0.3, MPI.COMM_SELF, mirror=mirror), n, precision)
    load, rows = np.ones(points.size, dtype), np.ones((3, points.rows))
    pair = traffic_of_pair(problem, nodes, comm.rank)
    assert passed(node, lambda: convolve(load, points.zeros(dtype))) == counted(pair)
    # The first sum makes the exchange.
    points.all_rows(rows)
    assert passed(node, lambda: points.all_rows(rows)) == counted(traffic_of_sum(nodes, comm.rank))
    # What goes to the others' memory, both ways, is what lies there.
    blocks = convolve._transposition.blocks
    here = {id(block) for _, block, _ in convolve._transposition._remote}
    columns = convolve._transposition.columns.shape[1]
    own = columns * points.rows * convolve.complex.itemsize
    assert pair.shared == 2 * (sum(block.nbytes for *_, block in blocks if id(block) not in here) - own)
    own = points.rows, columns, points.size
    assert np.array_equal(problem.shares(comm.size), np.transpose(comm.allgather(own)))
    comm.Free()


@pytest.mark.parametrize("mirror", ["", "x", "xy"])
def test_every_message_that_is_sent_is_received(mirror):
    problem = Problem.of(PunchPoints(Grid(40, 1.0), 0.3, MPI.COMM_SELF, mirror=mirror), 40)
    nodes = [0, 0, 1, 2, 2, 2]
    sent = sum(traffic_of_pair(problem, nodes, rank).sent for rank in range(len(nodes)))
    shared = sum(traffic_of_pair(problem, nodes, rank).shared for rank in range(len(nodes)))
    rows, columns, _ = problem.shares(len(nodes))
    kept = int((rows * columns).sum())
    # There and back, each row's columns go to another node, to another rank of this one, or stay.
    assert sent + shared + 2 * 16 * kept == 2 * 16 * problem.rows * problem.columns


def test_what_is_measured_counts_as_the_model_does(monkeypatch):
    from pgfmd.benchmark import ranks

    monkeypatch.setattr(ranks, "SECONDS", 0.01)
    comm = MPI.COMM_WORLD
    records = ranks.measure(comm, [ranks.TINY, 64])
    found = [(record["precision"], record["mirror"], record["n"]) for record in records]
    parts = [
        (precision, mirror)
        for precision, one in ranks.WITNESSES.items()
        for mirror in (ranks.MIRRORS if comm.size == 1 else (one,))
    ]
    assert found == [(*part, n) for part in parts for n in (ranks.TINY, 64)]
    for record in records:
        problem = ranks.forced(record["n"], record["precision"], record["mirror"])
        assert (record["ranks"], record["row_count"], record["column_count"]) == (
            comm.size,
            problem.rows,
            problem.columns,
        )
        assert record["points"] == problem.ends[-1] and record["pairs"] >= ranks.FEWEST
        assert record["sums"] >= 1.0 and all(
            record[part] > 0.0 for part in ("pair", "rows", "columns", "pass", "crowding")
        )
        if comm.size > 1 and len(Node.of(comm).ranks) == comm.size:
            # A meeting there, one back, and one a sum.
            assert record["meetings"] == pytest.approx(2.0 + record["sums"])
            assert record["messages"] == record["sent"] == record["gathers"] == 0
