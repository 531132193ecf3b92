"""Checkpoints of all ranks together, and runs that stop and go on: the same bits as without a stop."""

import contextlib
import json
import math
import os
import resource
import shutil
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import pgfmd.runner
from pgfmd.assemble import assemble
from pgfmd.errors import ResultError, RunError, SceneError, Stopped
from pgfmd.files.packing import arrays_of
from pgfmd.host.launch import RelayedError
from pgfmd.restart import checkpoint_file
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.restart.checkpoint_layout import Damaged, examine, read_head
from pgfmd.restart.checkpoint_policy import Timing
from pgfmd.restart.checkpoints import Checkpoints
from pgfmd.results import load
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene, precision
from tests.stopper import StopAfter

pytestmark = pytest.mark.mpi

SNAPSHOTS = 'output.snapshots=["0.5 s", "0.5 t_pl", "1.1 t_pl", "every 5 s"]'
SCENES = {
    "one element": ["tri-tack", "grid.n=24", "drive.preload=1 mN", SNAPSHOTS, "output.surface=true"],
    "five elements, mixed": [
        "hex-tack", "grid.n=27", "rheology.model=geometric", "rheology.relaxation_time=40 us", "rheology.elements=5",
        "rheology.time_ratio=6", "rheology.exponent=0.8", "drive.speed=20 um/s", "drive.dwell=10 ms",
        "drive.preload=1 mN", "solver.precision=mixed", "output.every=3",
    ],
    "quarter of a film, mixed": [
        "flat-punch", "grid.n=20", "substrate.thickness=0.4 mm", "solver.precision=mixed", SNAPSHOTS,
    ],
    "elastic, single, free, no audit": [
        "flat-punch", "grid.n=20", "rheology.model=elastic", "output.energy=false", "solver.precision=single",
        "substrate.boundary=free",
    ],
    "quasi-static, sprung, mixed": [
        "hex-tack", "grid.n=20", "solver.scheme=quasistatic", "solver.accuracy=0.03", "drive.preload=0.5 mN",
        "drive.machine_stiffness=2 kN/m", "solver.precision=mixed",
    ],
    "under load": ["tri-tack", "grid.n=20", "drive.control=load", "drive.preload=0.5 mN", "drive.speed=20 um/s"],
    "programme": [
        "flat-punch", "grid.n=20", "rheology.relaxation_time=20 ms", "rheology.modulus_ratio=10", "output.every=3",
        'drive.step=[{do="approach",speed="20 um/s",until="1 mN"},{do="hold",of="load",for="20 ms"},'
        '{do="retract",speed="20 um/s"}]', "drive.repeat.times=2", 'output.snapshots=["every 3 um", "step ends"]',
    ],
    "quasi-static": [
        "tri-tack", "grid.n=20", "solver.scheme=quasistatic", "solver.accuracy=0.05", "drive.preload=0.5 mN",
    ],
    "gfmd": [
        "tri-tack", "grid.n=20", "drive.preload=0.3 mN", "solver.scheme=gfmd", "drive.speed=800 um/s",
        "rheology.model=geometric", "rheology.relaxation_time=100 us", "rheology.elements=2", "rheology.time_ratio=6",
        "rheology.exponent=0.8", "output.every=20", "output.surface=true", 'output.snapshots=["1.1 t_pl"]',
    ],
}  # fmt: skip


@pytest.fixture
def comm():
    return MPI.COMM_WORLD


@pytest.fixture
def folder(tmp_path_factory):
    comm = MPI.COMM_WORLD
    yield Path(comm.bcast(str(tmp_path_factory.mktemp("restart")) if comm.rank == 0 else None))
    comm.Barrier()


@pytest.fixture
def stopping_after(monkeypatch):
    """Has runs stop after so many steps, counted from where they go on (the first look is at the start)."""
    monkeypatch.setattr(pgfmd.runner, "StopSignals", StopAfter)

    def set_after(steps):
        StopAfter.steps = steps

    yield set_after
    StopAfter.steps = math.inf


def silent(line):
    pass


DEFAULTS = Options()


def run(name, comm, folder, *more, options=DEFAULTS):
    source, *changes = SCENES[name]
    return run_scene(load_scene(source, [*changes, *more]), comm, folder, silent, options)


def run_in_links(name, comm, folder, most=1000):
    """A run that stops and goes on until it is finished; the number of stops."""
    for stops in range(most):
        try:
            run(name, comm, folder)
            return stops
        except Stopped:
            continue
    raise AssertionError(f"not finished after {most} links")


@contextlib.contextmanager
def file_size_limit(size):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


# -- the file ----------------------------------------------------------------------------------------------------------


def whole_arrays():
    rng = np.random.default_rng(1)
    return {
        "vector": rng.random(70_001),
        "branches": rng.random((3, 211)),
        "modes": rng.random((2, 30, 17)) + 1j * rng.random((2, 30, 17)),
        "single": rng.random(1000).astype(np.float32),
        "nothing": np.zeros((4, 0)),
        "no lines": np.zeros((0, 50)),
    }


def share_of(array, comm, uneven=False):
    width = array.shape[-1]
    edges = [width * k // comm.size for k in range(comm.size + 1)]
    if uneven and comm.size > 1:
        # The first rank has nothing, as a rank without rows under the punch.
        edges[1] = 0
    return np.ascontiguousarray(array[..., edges[comm.rank] : edges[comm.rank + 1]])


@pytest.mark.parametrize("uneven", [False, True])
def test_the_file_is_the_same_whoever_writes_it_and_anybody_can_read_it(comm, folder, uneven):
    whole = whole_arrays()
    head = {"state": {"least": -math.inf, "third": 1.0 / 3.0}}
    shares = {name: share_of(array, comm, uneven) for name, array in whole.items()}
    checkpoint_file.write(folder / "together.h5", comm, head, shares)
    if comm.rank == 0:
        checkpoint_file.write(folder / "alone.h5", MPI.COMM_SELF, head, whole)
        assert (folder / "together.h5").read_bytes() == (folder / "alone.h5").read_bytes()
        assert examine(folder / "together.h5")["state"] == head["state"]
    comm.Barrier()
    for reader_comm, wanted in ((comm, shares), (MPI.COMM_SELF, whole)):
        found = checkpoint_file.read_head(folder / "together.h5", reader_comm)
        read = checkpoint_file.Reader(folder / "together.h5", reader_comm, found)
        for name, expected in wanted.items():
            got = np.full_like(expected, np.nan)
            read(name, got)
            np.testing.assert_array_equal(got, expected)


def test_every_flipped_bit_and_every_truncation_is_found_on_all_ranks(comm, folder):
    """Bits anywhere in the file, and lengths: whatever it is, the checkpoint before is taken, or none."""
    checkpoints, shares = Checkpoints(folder, comm), {"a": share_of(np.arange(999.0), comm), "b": np.zeros(3)}
    for number in (1, 2):
        checkpoints.save({"state": {"number": number}}, shares)
    newest = checkpoints.newest
    content = newest.read_bytes()
    rng = np.random.default_rng(2)
    comm.Barrier()

    def restored():
        """(number in the head, warnings) of what is restored from."""
        found, said, fresh = {}, [], Checkpoints(folder, comm)

        def apply(head, read):
            for name, share in shares.items():
                read(name, np.empty_like(share))
            found["number"] = head["state"]["number"]

        fresh.restore(apply, said.append)
        return found["number"], len(said)

    assert restored() == (2, 0)
    # Many on one rank, where it is fast; on several, whether all find it.
    share = 1 if comm.size == 1 else 5
    damages = [("bit", int(bit)) for bit in rng.integers(0, 8 * len(content), 250 // share)]
    damages += [("length", int(length)) for length in rng.integers(0, len(content), 50 // share)]
    for kind, place in damages:
        if comm.rank == 0:
            changed = bytearray(content if kind == "bit" else content[:place])
            if kind == "bit":
                changed[place // 8] ^= 1 << place % 8
            # In place: the other name must not be changed with it.
            newest.unlink()
            newest.write_bytes(changed)
        comm.Barrier()
        assert restored() == (1, 1 if comm.rank == 0 else 0), (kind, place)
        comm.Barrier()


def test_without_a_valid_checkpoint_there_is_an_error_with_both_reasons(comm, folder):
    checkpoints = Checkpoints(folder, comm)
    checkpoints.save({"state": {}}, {"a": np.zeros(9)})
    if comm.rank == 0:
        os.truncate(checkpoints.newest, 100)
    comm.Barrier()
    with pytest.raises(ResultError) as caught:
        checkpoints.restore(lambda head, read: None, silent)
    assert "checkpoint.h5: its seal is changed" in str(caught.value) or "can't be read" in str(caught.value)
    assert "checkpoint.previous.h5: missing" in str(caught.value) and "--fresh" in str(caught.value)


def test_a_damaged_file_does_not_take_the_place_of_the_one_before(comm, folder):
    first = Checkpoints(folder, comm)
    for number in (1, 2):
        first.save({"state": {"number": number}}, {"a": np.full(9, number)})
    comm.Barrier()
    if comm.rank == 0:
        content = first.newest.read_bytes()
        first.newest.unlink()
        first.newest.write_bytes(content[:-5])
    comm.Barrier()
    second = Checkpoints(folder, comm)
    second.restore(lambda head, read: read("a", np.empty(9, dtype=np.int64)), silent)
    second.save({"state": {"number": 3}}, {"a": np.full(9, 3)})
    assert read_head(second.newest)["state"]["number"] == 3
    assert read_head(second.previous)["state"]["number"] == 1
    comm.Barrier()


def test_a_number_that_is_not_finite_is_named_and_never_becomes_the_newest(comm, folder):
    checkpoints = Checkpoints(folder, comm)
    good = np.zeros((2, 10))
    checkpoints.save({"state": {}}, {"state/branches": good})
    bad = good.copy()
    if comm.rank == comm.size - 1:
        bad[1, 4] = np.nan
    with pytest.raises(RunError) as caught:
        checkpoints.save({"state": {}}, {"state/branches": bad})
    assert f"state/branches[1, {10 * (comm.size - 1) + 4}] = nan on rank {comm.size - 1}" in str(caught.value)
    comm.Barrier()
    assert examine(checkpoints.newest) and sorted(os.listdir(folder)) == ["checkpoint.h5"]


@pytest.mark.parametrize("limit", [0, 3000, 5000, 20_000, 60_000])
def test_a_full_disk_leaves_the_checkpoint_of_before(comm, folder, limit):
    checkpoints = Checkpoints(folder, comm)
    checkpoints.save({"state": {"number": 1}}, {"a": np.zeros(9)})
    with file_size_limit(limit), pytest.raises(ResultError, match=r"checkpoint\.h5: could not be written"):
        checkpoints.save({"state": {"number": 2}}, {"a": share_of(np.zeros(10_000), comm)})
    comm.Barrier()
    assert sorted(os.listdir(folder)) == ["checkpoint.h5"]
    assert examine(checkpoints.newest)["state"]["number"] == 1
    comm.Barrier()


# -- runs --------------------------------------------------------------------------------------------------------------


# On three ranks, which may have to share cores, one of each scheme and of each way of sharing points.
OF_ALL_KINDS = ("one element", "quarter of a film, mixed", "quasi-static, sprung, mixed", "gfmd")


@pytest.mark.parametrize("name", SCENES if MPI.COMM_WORLD.size < 3 else OF_ALL_KINDS)
def test_a_chain_of_many_links_leaves_the_bits_of_one_run(name, comm, folder, stopping_after):
    record = run(name, comm, folder / "whole")
    # More ranks may have to share cores, where starting a link takes long.
    links = {1: 9, 2: 4}.get(comm.size, 3)
    stopping_after(max(0, record["steps"] // links - 1))
    stops = run_in_links(name, comm, folder / "chain")
    assert stops >= links - 1
    if comm.rank == 0:
        assert differences(folder / "whole", folder / "chain") == []
        chained = json.loads((folder / "chain" / "run.json").read_text())
        whole = json.loads((folder / "whole" / "run.json").read_text())
        clocks = ("wall_s", "transform_s", "checkpoint_s", "links", "peak_rss_bytes")
        assert {key: whole[key] for key in whole if key not in clocks} == {
            key: chained[key] for key in chained if key not in clocks
        }
        assert len(chained["links"]) == stops + 1
        assert sum(link["steps"] for link in chained["links"]) == chained["steps"] == record["steps"]
    comm.Barrier()


def test_going_on_at_every_step_leaves_the_bits_of_one_run(comm, folder, stopping_after):
    changes = ["grid.n=16", "drive.preload=0.3 mN", "rheology.model=elastic"]
    scene = load_scene("flat-punch", changes)
    record = run_scene(scene, comm, folder / "whole", silent)
    each = {1: 1, 2: 4}.get(comm.size, 8)
    stopping_after(each - 1)
    stops = 0
    while True:
        try:
            run_scene(scene, comm, folder / "chain", silent)
            break
        except Stopped:
            stops += 1
    assert stops >= record["steps"] // each - 1
    assert comm.bcast(differences(folder / "whole", folder / "chain") if comm.rank == 0 else None) == []


@pytest.mark.parametrize("name", ["one element", "quasi-static, sprung, mixed", "gfmd"])
def test_a_run_goes_on_with_another_number_of_ranks(name, comm, folder, stopping_after):
    """Begun by one rank, gone on with by all, ended by one."""
    if comm.rank == 0:
        steps = run(name, MPI.COMM_SELF, folder / "whole")["steps"]
        stopping_after(steps // 3)
        with pytest.raises(Stopped):
            run(name, MPI.COMM_SELF, folder / "shared")
    steps = comm.bcast(steps if comm.rank == 0 else None)
    stopping_after(steps // 3)
    with pytest.raises(Stopped):
        run(name, comm, folder / "shared")
    comm.Barrier()
    if comm.rank == 0:
        stopping_after(math.inf)
        record = run(name, MPI.COMM_SELF, folder / "shared")
        assert [link["ranks"] for link in record["links"]] == [1, comm.size, 1]
        assert differences(folder / "whole", folder / "shared") == []
    comm.Barrier()


def test_what_was_written_after_the_checkpoint_is_taken_back(comm, folder, stopping_after):
    """As after a crash: the files are ahead of the checkpoint, with half a row and snapshots too many."""
    name = "one element"
    run(name, comm, folder / "whole")
    stopping_after(12)
    with pytest.raises(Stopped):
        run(name, comm, folder / "crashed")
    kept = (folder / "crashed" / "checkpoint.h5").read_bytes()
    comm.Barrier()
    stopping_after(45)
    with pytest.raises(Stopped):
        run(name, comm, folder / "crashed")
    comm.Barrier()
    if comm.rank == 0:
        (folder / "crashed" / "checkpoint.h5").unlink()
        (folder / "crashed" / "checkpoint.h5").write_bytes(kept)
        with open(folder / "crashed" / "curve.csv", "a") as file:
            file.write("0.123,-1e-6,0.1")
    comm.Barrier()
    stopping_after(math.inf)
    run(name, comm, folder / "crashed")
    assert comm.bcast(differences(folder / "whole", folder / "crashed") if comm.rank == 0 else None) == []


def test_rows_that_the_checkpoint_knows_must_be_there(comm, folder, stopping_after):
    stopping_after(20)
    with pytest.raises(Stopped):
        run("one element", comm, folder / "out")
    comm.Barrier()
    if comm.rank == 0:
        curve = folder / "out" / "curve.csv"
        lines = curve.read_text().splitlines(keepends=True)
        curve.write_text("".join(lines[:5] + lines[6:]))
    comm.Barrier()
    with pytest.raises(ResultError, match=r"its first .* rows are not those that the checkpoint knows"):
        run("one element", comm, folder / "out")


def test_a_finished_run_is_not_run_again_unless_anew(comm, folder):
    record = run("one element", comm, folder / "out")
    before = (folder / "out" / "curve.csv").stat().st_mtime_ns
    again = run("one element", comm, folder / "out")
    assert again["steps"] == record["steps"] and (folder / "out" / "curve.csv").stat().st_mtime_ns == before
    comm.Barrier()
    run("one element", comm, folder / "out", options=Options(fresh=True))
    if comm.rank == 0:
        assert differences(folder / "out", folder / "out" / "previous-1") == []
        # Its checkpoints may be deleted to save space.
        for name in ("checkpoint.h5", "checkpoint.previous.h5"):
            (folder / "out" / name).unlink(missing_ok=True)
    comm.Barrier()
    assert run("one element", comm, folder / "out")["steps"] == record["steps"]
    with pytest.raises((SceneError, RelayedError), match="the run is over"):
        run("one element", comm, folder / "out", "drive.speed=2 um/s")


def test_results_without_a_checkpoint_are_not_overwritten(comm, folder):
    run("one element", comm, folder / "out", options=Options(timing=Timing(every=math.inf)))
    comm.Barrier()
    if comm.rank == 0:
        for name in ("checkpoint.h5", "run.json"):
            (folder / "out" / name).unlink()
    comm.Barrier()
    with pytest.raises((ResultError, RelayedError), match=r"but no checkpoint\.h5 to go on from"):
        run("one element", comm, folder / "out")


def test_few_rows_are_results_too(comm, folder, stopping_after):
    stopping_after(20)
    with pytest.raises(Stopped):
        run("one element", comm, folder / "out", "output.every=1000")
    comm.Barrier()
    if comm.rank == 0:
        (folder / "out" / "checkpoint.h5").unlink()
        (folder / "out" / "checkpoint.previous.h5").unlink()
    comm.Barrier()
    with pytest.raises((ResultError, RelayedError), match=r"but no checkpoint\.h5 to go on from"):
        run("one element", comm, folder / "out", "output.every=1000")


# -- a changed scene ---------------------------------------------------------------------------------------------------


REFUSED = {
    "grid.n=26": "grid.n",
    "solver.precision=single": "solver.precision",
    "rheology.relaxation_time=300 us": "rheology.relaxation_time",
    "drive.speed=2 um/s": "drive.speed",
    "drive.clearance=1 um": "drive.clearance",
    "output.energy=false": "output.energy",
    "output.patches=false": "output.patches",
    "drive.preload=2 mN": "drive.preload",
}
IN_APPROACH, IN_RETRACTION = 20, 50
"""Steps of the scene with one element."""


def test_a_changed_scene_is_refused_even_if_allowed(comm, folder, stopping_after):
    stopping_after(IN_RETRACTION)
    with pytest.raises(Stopped):
        run("one element", comm, folder / "out")
    stopping_after(math.inf)
    for change, key in REFUSED.items():
        for allow in ((), ("drive", "output", "solver")):
            with pytest.raises((SceneError, RelayedError), match=f"{key} = "):
                run("one element", comm, folder / "out", change, options=Options(allow=allow))
    assert run("one element", comm, folder / "out")["finished"] == "detached"


def test_all_ranks_keep_the_precision_that_the_run_began_with(comm, folder, stopping_after, monkeypatch):
    stopping_after(IN_APPROACH)
    with pytest.raises(Stopped):
        run("one element", comm, folder / "out", "solver.precision=double")
    stopping_after(math.inf)
    # As if mixed precision paid on so small a grid.
    monkeypatch.setattr(precision, "LEAST_SIDE", 1)
    assert load_scene(SCENES["one element"][0], SCENES["one element"][1:]).solver.precision == "mixed"
    assert run("one element", comm, folder / "out")["precision"] == "double"


def test_only_known_keys_can_be_allowed(comm, folder):
    with pytest.raises((SceneError, RelayedError), match=r"--allow = 'drive\.dwel': expected output\.every"):
        run("one element", comm, folder / "out", options=Options(allow=("drive", "drive.dwel")))


CHANGES = {
    "drive.retract_speed=3 um/s": "drive.retract_speed",
    "drive.preload=1.5 mN": "drive.preload",
    "drive.dwell=0.1 s": "drive",
    "solver.accuracy=3e-3": "solver.accuracy",
    "output.every=7": "output.every",
}


def test_what_is_to_come_may_change_if_allowed(comm, folder, stopping_after):
    stopping_after(IN_APPROACH)
    with pytest.raises(Stopped):
        run("one element", comm, folder / "begun")
    stopping_after(math.inf)
    for number, (change, key) in enumerate(CHANGES.items()):
        out = folder / str(number)
        if comm.rank == 0:
            shutil.copytree(folder / "begun", out)
        comm.Barrier()
        with pytest.raises((SceneError, RelayedError), match="--allow"):
            run("one element", comm, out, change)
        record = run("one element", comm, out, change, options=Options(allow=(key,)))
        assert record["finished"] == "detached" and record["links"][-1]["changed"][0].startswith(key)
        if comm.rank == 0:
            source, *changes = SCENES["one element"]
            phases = assemble(load_scene(source, [*changes, change]), MPI.COMM_SELF).phases
            assert read_head(out / "checkpoint.h5")["state"]["phase"] == len(phases) - 1
        comm.Barrier()


def test_another_preload_gives_snapshots_on_the_way_to_it_other_times(comm, folder, stopping_after):
    late = 'output.snapshots=["0.9 t_pl"]'
    stopping_after(15)
    with pytest.raises(Stopped):
        run("one element", comm, folder / "out", late)
    stopping_after(math.inf)
    more = "drive.preload=5 mN"
    run("one element", comm, folder / "out", late, more, options=Options(allow=("drive.preload",)))
    run("one element", comm, folder / "whole", late, more)
    if comm.rank == 0:
        times = []
        for name in ("out", "whole"):
            with load(folder / name) as results:
                times.append(float(results.fields["time"][list(results.labels).index("0.9 t_pl")]))
        assert times[0] == pytest.approx(times[1], rel=1e-2)
    comm.Barrier()


def test_snapshots_that_are_over_are_not_asked_for_again(comm, folder, stopping_after):
    """Stopped on the very step of a snapshot, and gone on with other ones of the same time."""
    first, then = 'output.snapshots=["1.1 t_pl"]', 'output.snapshots=["1.1 t_pl", "1.2 t_pl"]'
    record = run("one element", comm, folder / "whole", first)
    times = [0.0] + [
        float(line.split(",")[0]) for line in (folder / "whole" / "curve.csv").read_text().splitlines()[1:]
    ]
    due = next(row for row in (folder / "whole" / "events.csv").read_text().splitlines() if ",preload," in row)
    begin = float(due.split(",")[0]) - record["time_to_preload_s"]
    wanted = begin + 1.1 * record["time_to_preload_s"]
    step = int(np.argmin(np.abs(np.array(times) - wanted))) - 1
    stopping_after(step)
    with pytest.raises(Stopped):
        run("one element", comm, folder / "out", first)
    stopping_after(math.inf)
    run("one element", comm, folder / "out", then, options=Options(allow=("output",)))
    if comm.rank == 0:
        with load(folder / "out") as results:
            assert list(results.labels).count("1.1 t_pl") == list(results.labels).count("1.2 t_pl") == 1
    comm.Barrier()


def test_a_run_that_took_too_many_steps_goes_on_with_more(comm, folder):
    whole = run("one element", comm, folder / "whole")
    few = "solver.max_steps=30"
    assert run("one element", comm, folder / "out", few)["finished"] == "max_steps reached"
    record = run("one element", comm, folder / "out", options=Options(allow=("solver.max_steps",)))
    assert record["finished"] == "detached" and record["steps"] == whole["steps"]
    assert comm.bcast(differences(folder / "whole", folder / "out") if comm.rank == 0 else None) == []


def test_arrays_of_a_state_are_all_its_arrays(comm):
    """What packing finds by itself: every array with a part on this rank, in both schemes."""
    source, *changes = SCENES["one element"]
    state = assemble(load_scene(source, changes), MPI.COMM_SELF).run(attend=lambda run: run.state.counters.steps > 9)
    found, held = arrays_of(state), [value for value in vars(state).values() if isinstance(value, np.ndarray)]
    assert all(value is state.drift or any(value is share for share in found.values()) for value in held)
    assert {"past_u/0", "past_w/0"} <= set(found) and "modes" not in found
    with pytest.raises(Damaged):
        checkpoint_file.read_head(Path("nowhere.h5"), comm)
