"""What ranks pass to each other: the same numbers whether they share memory or send messages."""

import numpy as np
import pytest

pytest.importorskip("mpi4py")
from mpi4py import MPI

from pgfmd.solver.grid import Grid, PunchPoints, share
from pgfmd.solver.multiplier import periodic_multiplier
from pgfmd.solver.node import Node, RowExchange, Transposition
from pgfmd.solver.transform import Convolution

pytestmark = pytest.mark.mpi
world = MPI.COMM_WORLD


def arranged(colour_of):
    """A copy of the world whose ranks are on the nodes that `colour_of` says."""
    comm = world.Dup()
    Node.arrange(comm, colour_of(comm.rank))
    return comm


SPLITS = {
    "one node": lambda rank: 0,
    "each alone": lambda rank: rank,
    "first and rest": lambda rank: min(rank, 1),
    "odd and even": lambda rank: rank % 2,
}
splits = pytest.mark.parametrize("split", SPLITS)


@splits
@pytest.mark.parametrize("total", [1, 2, 17])
def test_numbers_of_all_rows_reach_all_ranks(split, total):
    comm = arranged(SPLITS[split])
    start, count = share(total, comm.size, comm.rank)
    exchange = RowExchange(Node.of(comm), start, count, total, 4)
    for call in range(5):
        kinds = 1 + call % 4
        everything = call + np.arange(kinds)[:, None] + 10.0 * np.arange(total)
        assert np.array_equal(exchange(everything[:, start : start + count]), everything)
    comm.Free()


@splits
@pytest.mark.parametrize("kind", [np.complex128, np.complex64])
@pytest.mark.parametrize("shape", [(1, 2), (7, 5), (12, 9)])
def test_rows_become_columns_and_rows_again(split, shape, kind):
    comm = arranged(SPLITS[split])
    rows, columns = ([share(size, comm.size, rank) for rank in range(comm.size)] for size in shape)
    whole = (np.arange(shape[0])[:, None] + 1j * np.arange(shape[1])).astype(kind)
    mine = slice(rows[comm.rank][0], sum(rows[comm.rank]))
    here = slice(columns[comm.rank][0], sum(columns[comm.rank]))
    transposition = Transposition(comm, rows, columns, kind)
    for factor in (1, 2, 3):
        for first, last, block in transposition.blocks:
            block[:] = factor * whole[mine, first:last]
        transposition.to_columns()
        assert np.array_equal(transposition.columns, factor * whole[:, here])
        transposition.columns *= 2
        transposition.to_rows()
        for first, last, block in transposition.blocks:
            assert np.array_equal(block, 2 * factor * whole[mine, first:last])
    comm.Free()


def test_a_convolution_has_the_same_bits_on_any_split_into_nodes():
    def surface(comm):
        points = PunchPoints(Grid(40, 1.0), 0.3, comm)
        convolve = Convolution(points, 40, periodic_multiplier(lambda qx, qy: 1.0 / (1.0 + qx**2 + qy**2), 1.0))
        x, y = points.coordinates()
        result = convolve(np.sin(9.0 * x) + np.cos(7.0 * y + x), points.zeros())
        return points.total_of(np.add.reduceat(result, points.offset[:-1])[None, :])[0], result

    expected = surface(MPI.COMM_SELF)[0]
    for split in SPLITS.values():
        comm = arranged(split)
        total, _ = surface(comm)
        assert total == expected
        comm.Free()


def test_memory_is_used_again_once_all_ranks_have_left_it():
    comm = arranged(SPLITS["one node"])
    node = Node.of(comm)
    for _ in range(20):
        RowExchange(node, *share(9, comm.size, comm.rank), 9, 3)
    assert len(node._pieces) <= 1
    comm.Free()


def test_without_shared_memory_messages_do(monkeypatch):
    comm = world.Dup()
    monkeypatch.setattr(Node, "_allocate", lambda self, sizes: None)
    node = Node.arrange(comm)
    assert node.ranks == [comm.rank] and node.count == comm.size
    start, count = share(8, comm.size, comm.rank)
    rows = np.arange(8.0)[None, :]
    assert np.array_equal(RowExchange(node, start, count, 8, 1)(rows[:, start : start + count]), rows)
    comm.Free()


def test_a_communicator_that_is_left_holds_no_memory():
    """What two of three ranks share would be given back by MPI at its end, in an order that the third one does not know."""
    comm = MPI.COMM_WORLD
    some = comm.Split(0 if comm.rank < 2 else 1, comm.rank)
    node = Node.of(some)
    exchange = RowExchange(node, 3 * some.rank, 3, 3 * some.size, 1)
    found = exchange(np.full((1, 3), float(some.rank)))
    np.testing.assert_array_equal(found[0], np.repeat(np.arange(some.size), 3))
    assert node.held > 0 or some.size == 1
    del exchange, found
    Node.leave(some)
    assert node.held == 0 and some.Get_attr(Node._key) is None
    some.Free()
