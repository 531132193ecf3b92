"""The model of more ranks, the profile of a machine, and how many ranks it deserves."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from pgfmd.benchmark.ranks import MIRRORS, TINY, WITNESSES, counts_to_measure, fitted, forced, usual
from pgfmd.commands.check import report
from pgfmd.forecast import machine_profile
from pgfmd.forecast.effort import effort_of
from pgfmd.forecast.machine_profile import NoProfile, Profile, identity
from pgfmd.forecast.run_times import problem_of, run_times
from pgfmd.forecast.scaling import (
    PARTS,
    Costs,
    Network,
    Problem,
    pair_seconds,
    total_seconds,
    traffic_of_pair,
    traffic_of_sum,
)
from pgfmd.scene import load_scene

EVEN = Problem(62, 32, 32 * np.arange(33))
"""32 rows of as many points, 32 columns: shared out evenly by 2, 4, ... 32 ranks."""
COSTS = Costs((64, 128), (2e-6, 4e-6), (4e-6, 8e-6), (100, 10_000), (5e-9, 5e-9), 0.0, 0.0)
AT_ONCE = Network(latency=0.0, message=0.0, bandwidth=math.inf)


# The model -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("ranks", [2, 4, 8, 16])
@pytest.mark.parametrize("per_node", [1, 2, None])
def test_without_latency_and_overhead_the_speed_up_is_ideal(ranks, per_node):
    alone = total_seconds(EVEN, 1, COSTS)
    assert total_seconds(EVEN, ranks, COSTS, per_node, AT_ONCE) == pytest.approx(alone / ranks, rel=1e-12)


def test_the_time_of_one_rank_is_that_of_its_parts():
    parts = pair_seconds(EVEN, 1, replace(COSTS, pair_overhead=1e-5, sum_overhead=2e-5))
    side = 62 * math.log2(62)
    assert tuple(parts) == PARTS
    assert parts["rows"] == pytest.approx(32 * 2e-6 / (64 * 6) * side)
    assert parts["pointwise"] == pytest.approx(3.0 * 1024 * 5e-9)
    assert parts["overhead"] == pytest.approx(7e-5)
    assert (
        parts["sums"] == parts["imbalance"] == parts["shared memory"] == parts["latency"] == parts["bandwidth"] == 0.0
    )


def test_latency_and_bytes_only_make_it_slower():
    def seconds(**changes):
        costs = replace(COSTS, **{key: value for key, value in changes.items() if hasattr(COSTS, key)})
        network = replace(AT_ONCE, **{key: value for key, value in changes.items() if hasattr(AT_ONCE, key)})
        return total_seconds(EVEN, 8, costs, 2, network)

    ideal = seconds()
    for name in ("meeting", "shared", "adding", "sum_overhead", "pair_overhead", "latency", "message"):
        assert ideal < seconds(**{name: 1e-9}) < seconds(**{name: 2e-9}), name
    assert ideal < seconds(bandwidth=2e9) < seconds(bandwidth=1e9)
    assert ideal < seconds(crowding=(1.0, 1.1)) < seconds(crowding=(1.0, 1.2))


def test_messages_take_latency_and_bandwidth():
    network = Network(latency=1e-3, message=1e-2, bandwidth=1e6)
    parts = pair_seconds(EVEN, 8, COSTS, 2, network)
    # 6 of 8 ranks are elsewhere; 4 rows by 4 columns go to each, 16 bytes each; and come back.
    assert parts["latency"] == pytest.approx(2 * 6 * 1e-2 + 2 * 1e-3)
    assert parts["bandwidth"] == pytest.approx(2 * (2 * 6 * 16 * 16) / 1e6)


def test_ranks_wait_for_the_slowest_of_each_stretch():
    shares = np.array([20, 12]), np.array([16, 16]), np.array([400, 624])
    parts = pair_seconds(EVEN, 2, COSTS, shares=shares)
    row, point = COSTS.of_line(COSTS.row, 62), 3.0 * 5e-9
    forward = max(10 * row + 160 * point, 6 * row + 0.4 * 624 * point)
    back = max(10 * row + 40 * point, 6 * row + 62.4 * point)
    slowest = forward + back + 312 * point
    assert parts["imbalance"] == pytest.approx(slowest - 16 * row - 512 * point)
    assert parts["rows"] == pytest.approx(16 * row) and parts["pointwise"] == pytest.approx(512 * point)


@pytest.mark.parametrize("mirror", MIRRORS)
@pytest.mark.parametrize("n", [64, 62])
def test_halves_and_quarters_share_out_what_they_have(n, mirror):
    """Counts as of the transforms: half the columns of a mirror image, half the rows of a quarter, pairs of rows."""
    whole, part = forced(n, "double", ""), forced(n, "double", mirror)
    assert part.ends[-1] * 2 ** len(mirror) == whole.ends[-1]
    assert part.rows == (whole.rows // 2 if "y" in mirror else whole.rows)
    assert part.columns == ((n // 2 + 1) // 2 if mirror else n // 2 + 1)
    assert part.length == (n // 2 if "y" in mirror else n)
    rows, columns, points = part.shares(3)
    assert (rows.sum(), columns.sum(), points.sum()) == (part.rows, part.columns, part.ends[-1])
    assert not (rows[:-1] % 2).any()
    # As many ranks as the model allows have all a row and a column.
    assert all(share.min() > 0 for share in part.shares(part.most_ranks)[:2])
    single = forced(n, "mixed", mirror)
    for nodes in ([0, 0, 0], [0, 1, 2]):
        double, mixed = (traffic_of_pair(problem, nodes, 1) for problem in (part, single))
        assert (double.shared, double.sent) == (2 * mixed.shared, 2 * mixed.sent) and double.messages == mixed.messages


def test_messages_of_single_numbers_have_half_the_bytes():
    network = Network(latency=1e-3, message=1e-2, bandwidth=1e6)
    double, mixed = (pair_seconds(replace(EVEN, precision=name), 8, COSTS, 2, network) for name in ("double", "mixed"))
    assert mixed["bandwidth"] == pytest.approx(0.5 * double["bandwidth"]) and mixed["latency"] == double["latency"]


def test_rows_of_one_node_go_through_its_memory():
    on_one, apart = traffic_of_pair(EVEN, [0] * 4, 0), traffic_of_pair(EVEN, [0, 1, 2, 3], 0)
    assert (on_one.messages, on_one.sent, on_one.meetings) == (0, 0, 2)
    assert (apart.messages, apart.shared, apart.meetings) == (6, 0, 0)
    assert on_one.shared == apart.sent == 2 * 8 * 24 * 16
    assert traffic_of_sum([0, 0, 1], 1).meetings == 2 and traffic_of_sum([0, 0, 1], 1).gathers == 0
    assert traffic_of_sum([0, 0, 1], 2).meetings == 0 and traffic_of_sum([0, 0, 1], 2).gathers == 1


# The number of ranks -------------------------------------------------------------------------------------------------
PARTS_STEPPED = [(precision, mirror) for precision in WITNESSES for mirror in MIRRORS]


def profile(start=(1.0, 1.5, 1.6, 1.7, 1.8, 1.9, 2.0, 2.1), **changes):
    """A machine on which all kinds of problems cost as much, for each row, column and point."""
    costs = replace(COSTS, pair_overhead=1e-5, sum_overhead=3e-5, meeting=1e-6, **changes)
    kinds = {forced(TINY, *part).kind: costs for part in PARTS_STEPPED}
    return Profile(identity(), 8, "2026-01-01 12:00", dict(enumerate(start, 1)), kinds)


def whole(n):
    return forced(n, "double", "")


def test_short_tests_deserve_one_rank_and_long_ones_more():
    machine, problem = profile(), whole(512)
    best = [machine.best_ranks(problem, pairs, 8) for pairs in (1, 100, 10_000, 1_000_000)]
    assert best == sorted(best) and best[0] == 1 and best[-1] == 8
    sizes = [machine.best_ranks(whole(n), 1000, 8) for n in (64, 128, 256, 512, 1024)]
    assert sizes == sorted(sizes) and sizes[0] == 1


def test_no_more_ranks_than_cores_or_rows():
    machine = profile()
    assert machine.best_ranks(whole(1024), 1e6, 3) == 3
    assert machine.best_ranks(whole(1024), 1e6, 100) == machine.best_ranks(whole(1024), 1e6) == 8
    assert machine.best_ranks(Problem(8, 3, 3 * np.arange(4)), 1e9) <= 3
    # Nothing is known of more ranks than were measured.
    assert profile(start=(1.0, 1.5)).best_ranks(whole(1024), 1e6, 8) == 2
    assert profile(start=(1.0,)).best_ranks(whole(1024), 1e6, 8) == 1


def test_cores_that_bring_hardly_anything_are_left_to_others():
    # Where work side by side takes as many times as long as there are ranks, nothing is won.
    crowded = profile(crowding=tuple(float(count) for count in range(1, 9)))
    assert crowded.best_ranks(whole(1024), 1e6, 8) == 1


def test_the_start_follows_what_was_measured():
    machine = Profile(identity(), 8, "", {1: 1.0, 2: 2.0, 4: 3.0}, {"double whole": COSTS})
    assert [machine.start_seconds(ranks) for ranks in (1, 2, 3, 4, 8)] == [1.0, 2.0, 2.5, 3.0, 3.0]
    assert Profile(identity(), 8, "", {1: 1.0}, {}).start_seconds(5) == 1.0
    assert machine.run_seconds(EVEN, 0, 3) == 2.5


def test_powers_of_two_and_all_cores_are_measured():
    assert counts_to_measure(1) == [1] and counts_to_measure(2) == [1, 2]
    assert counts_to_measure(12) == [1, 2, 4, 8, 12] and counts_to_measure(16) == [1, 2, 4, 8, 16]


def records_of(costs, counts=(1, 2), sizes=(TINY, 128, 512)):
    """What would be measured on a machine with such costs, by kind: one rank steps all parts, more step one."""
    found = []
    for precision, mirror, ranks, n in itertools.product(WITNESSES, MIRRORS, counts, sizes):
        if ranks > 1 and mirror != WITNESSES[precision]:
            continue
        problem = forced(n, precision, mirror)
        mine = costs[problem.kind]
        parts = pair_seconds(problem, ranks, mine)
        shared = traffic_of_pair(problem, [0] * ranks, 0).shared * mine.shared
        found.append({
            "ranks": ranks, "n": n, "precision": precision, "mirror": mirror, "row_count": problem.rows,
            "column_count": problem.columns, "points": int(problem.ends[-1]),
            "rows": parts["rows"] + shared, "columns": parts["columns"] + mine.pair_overhead,
            "pass": mine.sum_overhead + parts["pointwise"] / mine.sums, "sums": mine.sums, "pair": 1.0,
            "adding": mine.adding, "meeting": mine.meeting * (ranks > 1), "crowding": mine.crowd(ranks),
        })  # fmt: skip
    return found


def test_costs_of_each_kind_are_found_again_from_what_they_make():
    given = {}
    for factor, (precision, mirror) in enumerate(PARTS_STEPPED, 2):
        given[forced(TINY, precision, mirror).kind] = Costs(
            (128, 512), (factor * 1e-6, factor * 5e-6), (factor * 2e-6, factor * 9e-6),
            tuple(int(forced(n, precision, mirror).ends[-1]) for n in (128, 512)), (factor * 5e-9, factor * 6e-9),
            factor * 1e-5, factor * 3e-5, adding=1e-9, crowding=(1.0, 1.1 if precision == "double" else 1.05),
            meeting=1e-6, shared=2e-9 if precision == "double" else 3e-9,
        )  # fmt: skip
    found = fitted(records_of(given))
    assert found.keys() == given.keys() and len(found) == 6
    for kind, costs in given.items():
        for name in ("adding", "meeting", "crowding", "sizes", "points"):
            assert getattr(found[kind], name) == getattr(costs, name), (kind, name)
        for name in ("point", "sum_overhead"):
            assert getattr(found[kind], name) == pytest.approx(getattr(costs, name), rel=1e-3), (kind, name)
        # What the tiny test's rows and columns take is counted as overhead.
        for name in ("row", "column", "shared"):
            assert getattr(found[kind], name) == pytest.approx(getattr(costs, name), rel=0.1), (kind, name)


# The file ------------------------------------------------------------------------------------------------------------
@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def test_a_profile_is_read_as_it_was_written(cache):
    with pytest.raises(NoProfile, match="no profile of this machine: `pgfmd bench ranks`"):
        machine_profile.read()
    machine = profile(crowding=(1.0, 1.1))
    path = machine_profile.write(machine)
    assert path.is_relative_to(cache) and machine_profile.read() == machine


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("format", 1, "another version or machine, format = 1 and not 2: `pgfmd bench ranks` measures it"),
        ("pgfmd", "0.0.1", "another version or machine, pgfmd = '0.0.1'"),
        ("machine", "abacus", "another version or machine, machine = 'abacus'"),
        ("start", {}, "damaged"),
        ("cores", None, "damaged"),
        ("costs", {}, "damaged"),
        ("costs", {"double whole": {"sizes": [1]}}, "damaged"),
        ("start", {"1": -1.0}, "damaged .its numbers make no sense"),
    ],
)
def test_profiles_of_others_and_damaged_ones_are_refused(cache, key, value, said):
    path = machine_profile.write(profile())
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(NoProfile, match=said):
        machine_profile.read()


@pytest.mark.parametrize("text", ["", "[]", "{", '{"format": 2'])
def test_half_a_file_is_refused(cache, text):
    machine_profile.write(profile()).write_text(text)
    with pytest.raises(NoProfile, match="`pgfmd bench ranks` measures it"):
        machine_profile.read()


# check ---------------------------------------------------------------------------------------------------------------
def lines_of(ranks, *changes):
    found = report(load_scene("tri-tack", list(changes)), ranks)
    times = {
        line.name: (line.value, line.note) for line in found.sections["Cost"] if line.name.startswith("expected time")
    }
    return times, "\n".join(found.remarks)


def test_check_invents_nothing_without_a_profile(cache):
    times, said = lines_of(1)
    assert list(times) == ["expected time on 1 rank"] and "`pgfmd bench ranks`" in times["expected time on 1 rank"][1]
    assert "not known" not in said
    times, said = lines_of(4)
    assert list(times) == ["expected time on 1 rank"]
    assert "what 4 ranks would take is not known: no profile of this machine" in said


@pytest.mark.parametrize("change", ["solver.scheme=gfmd", "solver.precision=single"])
def test_check_tells_nothing_of_what_was_not_measured(cache, change):
    machine_profile.write(profile())
    times, said = lines_of(2, change)
    assert list(times) == ["expected time on 1 rank"] and "what 2 ranks would take is not known" in said


@pytest.mark.parametrize("n", [64, 256])
@pytest.mark.parametrize("changes", [[], ["solver.symmetry=none"], ["solver.precision=double"], ["punch.pattern=flat"]])
def test_check_gives_times_for_what_a_run_will_step(cache, monkeypatch, n, changes):
    """By default: half the points of this punch, or a quarter of a flat one, and from 256 points a side on in mixed precision."""
    monkeypatch.setattr("pgfmd.forecast.run_times.cores", lambda: 4)
    machine, changes = profile(), [f"grid.n={n}", *changes]
    part = "whole" if "solver.symmetry=none" in changes else "quarter" if "punch.pattern=flat" in changes else "half"
    kind = f"{'mixed' if n == 256 and 'solver.precision=double' not in changes else 'double'} {part}"
    # Only this kind is so dear that any time of another would be seen.
    costs = machine.costs | {kind: replace(machine.costs[kind], point=(1e-3, 1e-3))}
    machine_profile.write(replace(machine, costs=costs))
    scene = load_scene("tri-tack", changes)
    # Not as `check` prints them, as a range where the number of pairs is one.
    times, said = run_times(scene, 4)
    problem, pairs = problem_of(scene), effort_of(scene).pairs
    assert problem.kind == kind and not any("not known" in line for line in said)
    work = 3.0 * 1e-3 * problem.ends[-1] / 4
    assert {count: seconds for count, seconds, _ in times}[4] == pytest.approx(pairs * work, rel=0.3)


def test_check_names_the_better_number_of_ranks(cache, monkeypatch):
    monkeypatch.setattr("pgfmd.forecast.run_times.cores", lambda: 4)
    machine = profile(start=(1.0, 3.0, 4.0, 5.0))
    machine_profile.write(machine)
    times, said = lines_of(2, "grid.n=64")
    assert list(times) == ["expected time on 2 ranks", "expected time on 1 rank"]
    assert "1 rank would take about 0." in said and "times as long as 2 ranks" in said
    # Costs so small that one rank is best of this long test only if starts are dear.
    dear = profile(start=(1.0, 3.0, 4.0, 5.0), point=(1e-6, 1e-6))
    machine_profile.write(dear)
    times, said = lines_of(4, "grid.n=512")
    assert list(times) == ["expected time on 4 ranks"] and "ranks would" not in said
    times, said = lines_of(1, "grid.n=512")
    assert list(times) == ["expected time on 1 rank", "expected time on 4 ranks"]
    assert times["expected time on 1 rank"][0] > 2.0 * times["expected time on 4 ranks"][0]
    assert "4 ranks would take about" in said


def test_check_does_not_model_ranks_that_share_cores(cache, monkeypatch):
    monkeypatch.setattr("pgfmd.forecast.run_times.cores", lambda: 2)
    machine_profile.write(profile())
    times, said = lines_of(5)
    assert "expected time on 5 ranks" not in times
    assert "this process may use 2 cores, and more ranks than that wait for each other" in said
    machine_profile.write(profile(start=(1.0,)))
    times, said = lines_of(2, "grid.n=512")
    assert list(times) == ["expected time on 1 rank"]
    assert "what 2 ranks would take is not known, this machine was measured with 1 at most" in said


# bench ranks ---------------------------------------------------------------------------------------------------------
def bench_ranks(*arguments):
    from pgfmd import cli

    with pytest.raises(SystemExit) as ended:
        cli.main(["bench", "ranks", *arguments])
    return ended.value.code


@pytest.fixture
def surveyed(cache, monkeypatch):
    """A machine that has been measured at once; the sizes and numbers of ranks that it was asked for."""
    from pgfmd.benchmark import ranks

    asked = []

    def survey(sizes, counts, say):
        asked.append((list(sizes), list(counts)))
        machine = profile(crowding=(1.0, 1.25))
        return machine, records_of(machine.costs, counts, (TINY, *sizes))

    monkeypatch.setattr(ranks, "survey", survey)
    monkeypatch.setattr("pgfmd.host.processes.cores", lambda: 2)
    monkeypatch.setattr("pgfmd.host.ranks.launcher", lambda: "mpirun")
    return asked


def test_bench_prints_a_table_and_keeps_the_profile(surveyed, capsys):
    assert bench_ranks("512", "128", "512") == 0
    assert surveyed == [([128, 512], [1, 2])]
    shown = capsys.readouterr()
    lines = [line.split() for line in shown.out.splitlines()]
    assert ["2", "1.50", "25", "%", "25", "%"] in lines
    # The sizes that the profile knows; ranks and seconds for 100, 1000 and 10000 pairs.
    machine, row = machine_profile.read(), lines[-1]
    assert row[:3] == ["double", "half", "128"] and row[5::3] == ["s"] * 3
    assert usual(512).kind == "mixed half" and lines[-2][:3] == ["double", "half", "64"]
    for column, pairs in zip((3, 6, 9), (100, 1000, 10_000), strict=True):
        best = machine.best_ranks(usual(128), pairs)
        assert int(row[column]) == best
        assert float(row[column + 1]) == pytest.approx(machine.run_seconds(usual(128), pairs, best), rel=5e-3)
    assert f"kept for `pgfmd check`: {machine_profile.place()}" in shown.err


def test_bench_prints_json(surveyed, capsys):
    assert bench_ranks("128", "--most", "1", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert surveyed == [([128], [1])] and [record["n"] for record in found["pairs"]] == 6 * [TINY, 128]


def test_bench_starts_its_own_ranks(surveyed, monkeypatch, capsys):
    monkeypatch.setattr("pgfmd.host.launch.launched", lambda: (2, 0))
    assert bench_ranks("128") == 5 and not surveyed
    assert "start it without mpirun" in capsys.readouterr().err


def test_a_profile_that_can_not_be_kept_is_told(surveyed, cache, capsys):
    (cache / "pgfmd").write_text("in the way")
    assert bench_ranks("128") == 4
    assert "the profile of this machine can't be kept" in capsys.readouterr().err
