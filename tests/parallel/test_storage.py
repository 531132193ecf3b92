"""Writing results on any number of ranks: the same file however written, failures agreed on, crashes undone."""

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.errors import ResultError
from pgfmd.files import fields_layout
from pgfmd.files.storage import RESULTS, agree, make_directory, on_root, set_aside, write_run_json
from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import CURVE, ENERGY, CurveRow, EnergyRow
from pgfmd.host.launchers import environment_without
from pgfmd.output.fields_file import FieldsFile

pytestmark = pytest.mark.mpi

N, LENGTH, START, NB = 14, 2e-3, 3, 7


@pytest.fixture
def comm():
    return MPI.COMM_WORLD


@pytest.fixture
def folder(comm, tmp_path):
    """One empty folder for all ranks."""
    shared = comm.bcast(tmp_path)
    comm.Barrier()
    yield shared
    comm.Barrier()


def share(count: int, comm) -> slice:
    """Rows of this rank; the last rank of several has none, which more ranks than rows would give."""
    parts = max(1, comm.size - 1)
    edges = [round(count * part / parts) for part in range(parts + 1)] + [count]
    return slice(edges[comm.rank], edges[comm.rank + 1])


def block(name: str, frame: int) -> np.ndarray:
    """Numbers that name array, frame, row and column, with digits that single precision would lose."""
    row, column = np.indices((NB, NB))
    return {"gap": 1.0, "traction": 2.0, "displacement": 3.0}[name] * (frame + 1) + row / 7 + column / 1e9


def plane(frame: int) -> np.ndarray:
    row, column = np.indices((N, N))
    return -frame - row / 3 - column / 1e9


def inside() -> np.ndarray:
    position = np.arange(NB) - (NB - 1) / 2
    return np.hypot(position[:, None], position) <= NB / 2


def open_fields(path: Path, comm, surface: bool = False, parallel: bool | None = None) -> FieldsFile:
    rows = share(NB, comm)
    mine = rows.stop - rows.start
    return FieldsFile(path, comm, N, LENGTH, START, NB, rows.start, mine, inside()[rows], surface, parallel)


def add(fields: FieldsFile, comm, frame: int, surface: bool = False, label: str | None = None) -> None:
    rows, plane_rows = share(NB, comm), share(N, comm)
    arrays = [block(name, frame)[rows] for name in ("gap", "traction", "displacement")]
    extra = (plane(frame)[plane_rows], plane_rows.start) if surface else None
    fields.append(label or f"moment {frame}", 0.5 * frame, -1e-6 * frame, 1e-3 * frame, *arrays, surface=extra)


@contextlib.contextmanager
def file_size_limit(size: int):
    """A disk that is full for files beyond `size` bytes: the write fails with EFBIG instead of ENOSPC."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def same_on_all(comm, value: object) -> bool:
    return len(set(comm.allgather(value))) == 1


def row(k: int) -> CurveRow:
    areas = 1e-9 * k, 0.9e-9 * k, 1.1e-9 * k
    return CurveRow(0.1 * k, -k / 3, k / 3 - 1e-6, 1e-3 / 7 * k, *areas, float("nan"), 0.1, 1, 1, "approach")


# -- agreement, folder, run.json ---------------------------------------------------------------------------------------


def test_agree_gives_every_rank_the_text_of_the_lowest_rank_that_failed(comm):
    agree(comm, None)
    failing = comm.rank == comm.size - 1
    with pytest.raises(ResultError) as caught:
        agree(comm, OSError(28, "No space left on device") if failing else None)
    assert str(caught.value) == "No space left on device"


def made(folder, comm):
    """The results folder, made as a run makes it."""
    on_root(comm, f"{folder}: can't be used as a results folder", lambda: make_directory(folder))
    return folder


def test_results_are_set_aside_and_nothing_else(comm, folder):
    target = made(folder / "out", comm)
    assert on_root(comm, "aside", lambda: set_aside(target)) is None
    for k in (1, 2):
        if comm.rank == 0:
            for name in (*RESULTS, "stress-maps.png", "notes.txt"):
                (target / name).write_text(f"{name} {k}")
        moved = on_root(comm, "aside", lambda: set_aside(target))
        assert moved == (target / f"previous-{k}" if comm.rank == 0 else None)
        moved = target / f"previous-{k}"
        comm.Barrier()
        assert {file.name for file in moved.iterdir()} == {*RESULTS, "stress-maps.png"}
        assert (moved / "curve.csv").read_text() == f"curve.csv {k}"
        assert (target / "notes.txt").exists() and not (target / "curve.csv").exists()
        comm.Barrier()


def test_missing_folders_are_made(comm, folder):
    assert made(folder / "missing" / "out", comm).is_dir()


@pytest.mark.parametrize("where", ["file", "file/out"])
def test_making_a_folder_fails_alike_on_all_ranks(comm, folder, where):
    if comm.rank == 0:
        (folder / "file").write_text("")
    with pytest.raises(ResultError, match=where) as caught:
        made(folder / where, comm)
    assert same_on_all(comm, str(caught.value))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_write_permission_is_refused(comm, folder):
    if comm.rank == 0:
        (folder / "sealed").mkdir(mode=0o555)
    with pytest.raises(ResultError, match="Permission denied"):
        made(folder / "sealed", comm)


def test_run_json_keeps_order_and_turns_what_json_lacks_into_null(comm, folder):
    path = folder / "run.json"
    record = {"z": np.float64(0.1), "a": {"rank": np.int64(3), "bad": [float("nan"), np.inf]}, "flag": np.bool_(True)}
    write_run_json(path, comm, record | {"array": np.array([1.0, np.nan]), "path": Path("x/y")})
    found = json.loads(path.read_text())
    assert list(found) == ["z", "a", "flag", "array", "path"]
    assert found == {"z": 0.1, "a": {"rank": 3, "bad": [None, None]}, "flag": True, "array": [1.0, None], "path": "x/y"}


def test_run_json_survives_a_full_disk(comm, folder):
    path = folder / "run.json"
    write_run_json(path, comm, {"steps": 1})
    with file_size_limit(100), pytest.raises(ResultError, match=r"run\.json: could not be written: File too large"):
        write_run_json(path, comm, {"text": "x" * 200})
    assert json.loads(path.read_text()) == {"steps": 1}
    assert list(folder.iterdir()) == [path]


# -- tables ------------------------------------------------------------------------------------------------------------


def test_curve_holds_every_digit_and_grows_at_once(comm, folder):
    path = folder / "curve.csv"
    curve = TableFile(CURVE, path, comm)
    for k in range(5):
        curve.append(row(k))
        assert len(path.read_text().splitlines()) == k + 2
        comm.Barrier()
    lines = path.read_text().splitlines()
    assert lines[0] == (
        "time [s],displacement [m],indentation [m],force [N],contact_area [m^2],overlap_area [m^2],near_area [m^2],"
        "u_inf [m],step [s],cycle,stage,phase"
    )
    values = lines[4].split(",")
    assert [float(value) for value in values[:5]] == [0.1 * 3, -1.0, 1 - 1e-6, 1e-3 / 7 * 3, 1e-9 * 3]
    assert values[7] == "nan" and values[9:] == ["1", "1", "approach"]
    curve.close()


def test_every_and_forced_rows(comm, folder):
    curve = TableFile(CURVE, folder / "curve.csv", comm, every=4)
    for k in range(10):
        curve.append(row(k), force_write=k == 6)
    times = [line.split(",")[0] for line in (folder / "curve.csv").read_text().splitlines()[1:]]
    assert [float(time) for time in times] == [0.1 * k for k in (0, 4, 6, 8)]
    assert (curve.rows, curve.offered) == (4, 10)


def test_continued_and_cut_back_curve_equals_an_uninterrupted_one(comm, folder):
    whole, broken = (TableFile(CURVE, folder / f"{name}.csv", comm, every=3) for name in ("whole", "broken"))
    for k in range(11):
        whole.append(row(k))
    for k in range(5):
        broken.append(row(k))
    mark = broken.mark()
    assert (mark is None) == (comm.rank > 0)
    mark = comm.bcast(mark)
    for k in range(5, 8):
        broken.append(row(100 * k))
    broken.close()
    if comm.rank == 0:
        with open(folder / "broken.csv", "a") as file:
            file.write("0.7,-2.3")
    comm.Barrier()
    broken = TableFile(CURVE, folder / "broken.csv", comm, every=3)
    assert broken.rows == 3
    broken.cut_back(mark)
    assert broken.offered == 5
    for k in range(5, 11):
        broken.append(row(k))
    assert (folder / "broken.csv").read_bytes() == (folder / "whole.csv").read_bytes()


def test_curve_refuses_a_foreign_table_and_missing_rows(comm, folder):
    TableFile(ENERGY, folder / "table.csv", comm).append(EnergyRow(*range(7)))
    before = (folder / "table.csv").read_bytes()
    comm.Barrier()
    with pytest.raises(ResultError, match="its columns are not time"):
        TableFile(CURVE, folder / "table.csv", comm)
    assert (folder / "table.csv").read_bytes() == before
    table = TableFile(ENERGY, folder / "table.csv", comm)
    mark = comm.bcast(table.mark())
    table.append(EnergyRow(*range(7)))
    table.cut_back(mark)
    assert table.rows == 1 and (folder / "table.csv").read_bytes() == before
    table.close()
    comm.Barrier()
    for changed in (before[:-1], before.replace(b"3.0", b"4.0")):
        assert changed != before
        if comm.rank == 0:
            (folder / "table.csv").write_bytes(changed)
        comm.Barrier()
        with pytest.raises(ResultError, match="its first 1 rows are not those that the checkpoint knows"):
            TableFile(ENERGY, folder / "table.csv", comm).cut_back(mark)
        comm.Barrier()


def test_full_disk_leaves_whole_lines(comm, folder):
    path = folder / "curve.csv"
    curve = TableFile(CURVE, path, comm)

    def fill():
        for k in range(1, 50):
            curve.append(row(k))

    with file_size_limit(400), pytest.raises(ResultError) as caught:
        fill()
    assert str(caught.value) == f"{path}: could not be written: File too large"
    text = path.read_text()
    assert text.endswith("approach\n") and len(text.splitlines()) == curve.rows + 1 > 2
    comm.Barrier()
    curve.append(row(50))
    assert path.read_text().splitlines()[-1].startswith("5.0,")


def test_folder_that_is_gone(comm, folder):
    with pytest.raises(ResultError, match=r"curve\.csv: could not be opened: No such file or directory"):
        TableFile(CURVE, folder / "gone" / "curve.csv", comm)


# -- snapshots ---------------------------------------------------------------------------------------------------------

PARALLEL = [False, pytest.param(True, marks=pytest.mark.skipif(not h5py.get_config().mpi, reason="h5py has no MPI"))]


@pytest.mark.parametrize("parallel", PARALLEL)
@pytest.mark.parametrize(("surface", "engine"), [(False, "h5netcdf"), (True, "netcdf4")])
def test_snapshots_are_what_xarray_reads(comm, folder, parallel, surface, engine):
    xarray = pytest.importorskip("xarray")
    path = folder / "fields.h5"
    fields = open_fields(path, comm, surface, parallel)
    labels = ["snap-in", "µ" * 41, "pull-off"]
    for frame, label in enumerate(labels):
        add(fields, comm, frame, surface, label)
        assert fields.frames == frame + 1
    with xarray.open_dataset(path, engine=engine) as data:
        assert data["gap"].dims == ("snapshot", "y", "x") and data["gap"].dtype == np.float64
        assert data["traction"].attrs["units"] == "Pa" and data["gap"].attrs["units"] == "m"
        for frame in range(3):
            for name in ("gap", "traction", "displacement"):
                expected = np.where(inside(), block(name, frame), np.nan)
                np.testing.assert_array_equal(data[name][frame], expected)
        spacing = LENGTH / N
        np.testing.assert_allclose(data["x"], (np.arange(START, START + NB) + 0.5 - N / 2) * spacing, rtol=1e-15)
        assert {"x", "y", "time", "punch_position", "force", "label"} <= set(data["gap"].coords)
        np.testing.assert_array_equal(data["time"], [0, 0.5, 1])
        np.testing.assert_array_equal(data["punch_position"], [0, -1e-6, -2e-6])
        np.testing.assert_array_equal(data["force"], [0, 1e-3, 2e-3])
        assert list(data["label"].values) == ["snap-in", "µ" * 40, "pull-off"]
        assert ("surface_displacement" in data) == surface
        if surface:
            np.testing.assert_array_equal(data["surface_displacement"], [plane(frame) for frame in range(3)])
            assert data["surface_displacement"].dims == ("snapshot", "y_cell", "x_cell")
            assert data["x_cell"].size == N


@pytest.mark.skipif(not h5py.get_config().mpi, reason="h5py has no MPI")
def test_gathered_and_parallel_files_have_the_same_bytes(comm, folder):
    for parallel, name in ((True, "together.h5"), (False, "gathered.h5")):
        fields = open_fields(folder / name, comm, surface=True, parallel=parallel)
        for frame in range(3):
            add(fields, comm, frame, surface=True)
    assert (folder / "together.h5").read_bytes() == (folder / "gathered.h5").read_bytes()


def test_default_follows_h5py_and_gathering_is_said_once(comm, folder, monkeypatch, capsys):
    assert open_fields(folder / "default.h5", comm).parallel == (h5py.get_config().mpi and comm.size > 1)

    class Plain:
        mpi = False

    monkeypatch.setattr(h5py, "get_config", lambda: Plain)
    monkeypatch.setattr("pgfmd.output.fields_file._noticed", False)
    for name in ("one.h5", "two.h5"):
        assert not open_fields(folder / name, comm).parallel
    assert capsys.readouterr().out.count("gathered to rank 0") == (1 if comm.rank == 0 and comm.size > 1 else 0)
    with pytest.raises(ResultError, match="this h5py has no MPI"):
        open_fields(folder / "three.h5", comm, parallel=True)


def test_continued_and_cut_back_snapshots(comm, folder):
    path = folder / "fields.h5"
    fields = open_fields(path, comm)
    for frame in (0, 1, 7, 8):
        add(fields, comm, frame)
    fields = open_fields(path, comm)
    assert fields.frames == 4
    fields.truncate(2)
    add(fields, comm, 2)
    with pytest.raises(ResultError, match="holds 3 snapshots, can't be cut back to 4"):
        fields.truncate(4)
    with h5py.File(path) as data:
        np.testing.assert_array_equal(data["snapshot"], [0, 1, 2])
        np.testing.assert_array_equal(data["time"], [0, 0.5, 1])
        for frame in range(3):
            np.testing.assert_array_equal(data["gap"][frame], np.where(inside(), block("gap", frame), np.nan))


def test_wrong_shape_on_one_rank_is_refused_by_all(comm, folder):
    fields = open_fields(folder / "fields.h5", comm)
    add(fields, comm, 0)
    rows = share(NB, comm)
    arrays = [block(name, 0)[rows] for name in ("gap", "traction", "displacement")]
    if comm.rank == 0:
        arrays[1] = arrays[1][:, :-1]
    with pytest.raises(ResultError, match="traction on rank 0 has the shape") as caught:
        fields.append("bad", 0.0, 0.0, 0.0, *arrays)
    assert same_on_all(comm, str(caught.value))
    add(fields, comm, 1)
    assert open_fields(folder / "fields.h5", comm).frames == 2


def test_rows_that_do_not_make_up_the_block(comm, folder):
    with pytest.raises(ValueError, match="do not make up 7 rows"):
        FieldsFile(folder / "fields.h5", comm, N, LENGTH, START, NB, 1, 2, np.ones((2, NB), bool))


def test_surface_asked_for_but_not_given(comm, folder):
    fields = open_fields(folder / "fields.h5", comm, surface=True)
    with pytest.raises(ResultError, match="surface_displacement"):
        add(fields, comm, 0, surface=False)


def test_foreign_grid_and_foreign_file_are_refused(comm, folder):
    open_fields(folder / "fields.h5", comm)
    with pytest.raises(ResultError, match="its surface is 0, the run's is 1"):
        open_fields(folder / "fields.h5", comm, surface=True)
    comm.Barrier()
    if comm.rank == 0:
        (folder / "text.h5").write_text("no HDF5")
    comm.Barrier()
    with pytest.raises(ResultError, match=r"text\.h5: can't be continued.*it is damaged"):
        open_fields(folder / "text.h5", comm)
    assert (folder / "text.h5").read_text() == "no HDF5"


@pytest.mark.parametrize("parallel", PARALLEL)
def test_full_disk_leaves_the_earlier_snapshots(comm, folder, parallel):
    path = folder / "fields.h5"
    fields = open_fields(path, comm, parallel=parallel)
    add(fields, comm, 0)
    before = path.read_bytes()
    comm.Barrier()
    with file_size_limit(len(before) + 1000), pytest.raises(ResultError) as caught:
        add(fields, comm, 1)
    assert str(caught.value) == f"{path}: could not be written: File too large"
    assert path.read_bytes() == before and list(folder.iterdir()) == [path]
    comm.Barrier()
    add(fields, comm, 1)
    assert fields.frames == 2


def test_a_crash_at_any_point_of_an_addition_is_undone(comm, folder, monkeypatch):
    path = folder / "fields.h5"
    fields = open_fields(path, comm)
    add(fields, comm, 0)
    before = path.read_bytes()
    comm.Barrier()
    for name in ("resize", "describe", "forget"):
        with monkeypatch.context() as patch:
            patch.setattr(fields_layout, name, lambda *args, **kwargs: (_ for _ in ()).throw(OSError(5, "died")))
            with pytest.raises(ResultError, match="Input/output error"):
                add(fields, comm, 1)
        if comm.rank == 0 and name != "forget":
            # What HDF5 leaves half written when it is killed: every byte that the undo file claims to keep may be lost.
            damaged = bytearray(path.read_bytes())
            damaged[:200] = bytes(200)
            path.write_bytes(damaged)
        comm.Barrier()
        fields = open_fields(path, comm)
        assert fields.frames == 1 and path.read_bytes() == before
        comm.Barrier()
    add(fields, comm, 1)
    assert fields.frames == 2


KILLED = """
import sys, numpy as np
from mpi4py import MPI
from pgfmd.output.fields_file import FieldsFile
fields = FieldsFile(sys.argv[1], MPI.COMM_SELF, 64, 1.0, 0, 64, 0, 64, np.ones((64, 64), bool))
print("open", fields.frames, flush=True)
while True:
    arrays = [np.full((64, 64), float(fields.frames))] * 3
    fields.append("again", float(fields.frames), 0.0, 0.0, *arrays)
"""


def test_killed_at_random_times_the_file_is_always_continued(comm, folder):
    if comm.rank:
        pytest.skip("one rank is enough to start the process that is killed")
    path, random, frames = folder / "fields.h5", np.random.default_rng(1), 0
    for _ in range(4):
        command = [sys.executable, "-c", KILLED, str(path)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment_without())
        assert process.stdout.readline().startswith("open")
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(random.uniform(0.05, 0.3))
        process.kill()
        assert process.wait() == -signal.SIGKILL
        fields = FieldsFile(path, MPI.COMM_SELF, 64, 1.0, 0, 64, 0, 64, np.ones((64, 64), bool))
        assert fields.frames >= frames
        frames = fields.frames
        with h5py.File(path) as data:
            np.testing.assert_array_equal(data["gap"][:, 5, 7], np.arange(frames))
            np.testing.assert_array_equal(data["time"], np.arange(frames))
    assert frames > 4


READER = """
import sys, h5py
file = h5py.File(sys.argv[1], "r")
print("open", flush=True)
sys.stdin.read()
"""


def test_somebody_who_looks_at_snapshots_does_not_stop_the_run(comm, folder):
    path = folder / "fields.h5"
    fields = open_fields(path, comm)
    add(fields, comm, 0)
    reader = None
    if comm.rank == 0:
        command = [sys.executable, "-c", READER, str(path)]
        reader = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment_without()
        )
        assert reader.stdout.readline() == "open\n"
    comm.Barrier()
    try:
        add(fields, comm, 1)
    finally:
        if reader is not None:
            reader.communicate()
    assert fields.frames == 2


def test_columns_are_those_of_the_rows():
    assert len(CURVE.titles) == len(CurveRow.__dataclass_fields__)
