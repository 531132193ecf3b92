"""The tables of the page on ranks, from a machine that is made up."""

import argparse
import re
from dataclasses import replace

import numpy as np
import pytest

from pgfmd.benchmark import ranks as bench
from pgfmd.forecast.machine_profile import Profile
from pgfmd.forecast.scaling import Costs, Network, Problem, pair_seconds, traffic_of_pair
from scripts.studies.pages import page_named
from scripts.studies.ranks import model

COSTS = Costs(
    (512, 1024), (2e-6, 4e-6), (4e-6, 8e-6), (51468, 205892), (8e-9, 8e-9), 2e-5, 4e-5, meeting=1e-6, look=1e-7,
)  # fmt: skip
NETWORK = Network()
PARTS_STEPPED = [(precision, mirror) for precision in bench.WITNESSES for mirror in bench.MIRRORS]
WHOLE = ["solver.symmetry=none", "solver.precision=double"]


def whole(n):
    return bench.forced(n, "double", "")


def made(options, changes=()):
    """The tables of a machine where all kinds of points cost as much."""
    options.n, options.ranks, options.set = [512, 1024], [1, 2, 3], list(changes)
    return model.blocks(options)


def test_each_block_of_the_page_has_a_table(monkeypatch):
    sums = 3.5
    records = [
        {"n": n, "ranks": count, "sums": sums, "pair": 1e-3 / count, "precision": precision, "mirror": mirror}
        for n in (bench.TINY, 512, 1024) for count in (1, 2, 3) for precision, mirror in PARTS_STEPPED
    ]  # fmt: skip
    costs = {bench.forced(bench.TINY, *part).kind: COSTS for part in PARTS_STEPPED}
    monkeypatch.setattr(
        bench, "survey", lambda *given: (Profile("abacus", 2, "today", {1: 1.0, 2: 1.5}, costs), records)
    )
    parser = argparse.ArgumentParser()
    model.arguments(parser)
    options = parser.parse_args(["--bandwidth", "25", "--crowding", "1.5"])
    found = made(options)
    page = page_named("ranks.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"<!-- model ([\w-]+) -->", page)) == sorted(found)
    assert re.findall(r"<!-- (?:shares|speed) ([\w-]+) -->", page) == ["whole", "after", "before"]
    for text in found.values():
        for block in text.split("\n\n"):
            widths = {line.count("|") for line in block.splitlines() if line.startswith("|")}
            assert len(widths) <= 1
        assert "| --- |" in text and "nan" not in text and "inf" not in text
    assert "25 GB/s" in found["large"] and "1.5 times as long" in found["large"] and "too many" in found["large"]
    # Of three ranks on two cores the model says nothing.
    assert found["measured"].count("| (") == 4
    assert "mixed half points, as runs choose" in found["large"] and "| mixed half | 512 |" in found["traffic"]
    # Whole and in double precision there are four times the bytes, as many meetings, and as many ranks have work.
    double = made(options, WHOLE)
    assert "double whole points (solver.symmetry=none, solver.precision=double)" in double["large"]
    for n in (512, 1024):
        bytes_of = [traffic_of_pair(bench.usual(n, changes), [0, 1], 0).sent for changes in (WHOLE, [])]
        assert bytes_of[0] / bytes_of[1] == pytest.approx(4.0, rel=0.02)
    assert double["large"].count("too many") == found["large"].count("too many")


@pytest.mark.parametrize("part", [("double", ""), ("mixed", "x")])
@pytest.mark.parametrize("row", [0.0, 0.6])
def test_rows_by_points_or_work_are_all_shared_out(row, part):
    problem = bench.forced(1024, *part)
    rows, columns, points = model._by(problem, 16, row)
    assert (rows.sum(), columns.sum(), points.sum()) == (problem.rows, problem.columns, problem.ends[-1])
    work = points + row * np.diff(problem.ends).max() * rows
    # Pairs of rows, of mirror images, can't be torn apart.
    assert work.max() < (1.06 if problem.mirror else 1.03) * work.mean() and rows[0] > rows[8]
    assert not problem.mirror or not (rows % 2).any()


def test_joined_messages_save_latency_and_no_bytes():
    problem = whole(8192)
    now, joined = (make(problem, 1024, COSTS, 64, NETWORK) for make in (pair_seconds, model.joined_seconds))
    assert traffic_of_pair(problem, [rank // 64 for rank in range(1024)], 0).messages == 2 * 960
    # 15 other nodes are served by 64 ranks: a message there and one back each, at most.
    assert joined["latency"] == pytest.approx(2 * NETWORK.message + 2 * NETWORK.latency)
    assert joined["bandwidth"] == now["bandwidth"]
    assert joined["shared memory"] == pytest.approx(now["shared memory"] + 2 * (1e-6 + 62e-7))
    alone = model.joined_seconds(problem, 64, COSTS, 64, NETWORK)
    assert alone == pair_seconds(problem, 64, COSTS, 64, NETWORK)


def test_blocks_send_three_times_the_bytes_of_slabs():
    assert model.blocks_of(1024) == (32, 32) and model.blocks_of(48) == (8, 6) and model.blocks_of(7) == (7, 1)
    # Every rank a node, so that all goes through the network, but for what stays on a rank. 2048 rows, 2048 columns.
    problem = Problem(4094, 2048, 2048 * np.arange(2049))
    slabs = pair_seconds(problem, 1024, COSTS, 1, NETWORK)["bandwidth"]
    blocks = model.pencil_seconds(problem, 1024, COSTS, 1, NETWORK)["bandwidth"]
    stays = 1.0 - 1.0 / 1024, 1.0 - 1.0 / 32
    assert blocks / slabs == pytest.approx(3.0 * stays[1] / stays[0], rel=2e-3)
    ideal = replace(COSTS, pair_overhead=0.0, sum_overhead=0.0, meeting=0.0, look=0.0, sums=1e-12)
    free = Network(0.0, 0.0, np.inf)
    alone = sum(pair_seconds(problem, 1, ideal).values())
    assert sum(model.pencil_seconds(problem, 1024, ideal, 64, free).values()) == pytest.approx(alone / 1024)
