"""Every byte with a checksum counts: damage to checkpoints, snapshots and tables is found, and named."""

import contextlib
import os
from functools import partial

import h5py
import numpy as np
import pytest

from pgfmd import cli
from pgfmd.errors import ResultError
from pgfmd.files import fields_layout, storage
from pgfmd.files.checksum import whole_sum
from pgfmd.files.hdf5 import open_serial
from pgfmd.host import run_lock
from pgfmd.host.run_lock import Holder, RunLock
from pgfmd.restart.checkpoint_layout import SEAL_BYTES, read_head
from pgfmd.results import verify
from tests.unit.small_runs import damage_an_array, flip, run

ARRAYS = ("gap", "traction", "displacement", "surface_displacement")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A finished run that keeps whole surfaces, and one stopped on its way in."""
    folder = tmp_path_factory.mktemp("runs")
    run(folder / "finished", "output.surface=true")
    run(folder / "stopped", stop_after=25)
    return folder


def wrong(folder):
    """File name -> what is wrong with it."""
    return {part.path.name: f"{part.found}; {part.cure}" for part in verify.verify(folder) if not part.fine}


@contextlib.contextmanager
def locked(folder):
    lock = RunLock.acquire(folder, 1)
    try:
        yield
    finally:
        lock.release()


def layout_of(folder):
    """The layout of a run's snapshots."""
    with open_serial(folder / "fields.h5", "r") as file:
        about = {name: file.attrs[name] for name in ("n", "length", "block_start", "nb", "surface")}
    return fields_layout.Layout(**{**about, "surface": bool(about["surface"])})


def place_of(folder, name, frame):
    """(offset, bytes) of an array of a snapshot in its file."""
    with open_serial(folder / "fields.h5", "r") as file:
        array = file[name]
        chunk = array.id.get_chunk_info_by_coord((frame, 0, 0))
        return chunk.byte_offset, 8 * array.shape[1] * array.shape[2]


def test_whole_folders_are_fine(finished, stopped):
    parts = list(verify.verify(finished))
    assert [part.path.name for part in parts] == [
        "checkpoint.h5",
        "curve.csv",
        "energy.csv",
        "events.csv",
        "patches.csv",
        "sites.csv",
        "fields.h5",
        "scene.resolved.toml",
        "run.json",
    ]
    assert all(part.fine for part in parts)
    assert "3 snapshots of 4 arrays" in str(parts[6]) and "detached" in str(parts[8])
    assert wrong(stopped) == {}


# -- checkpoints -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["checkpoint.h5", "checkpoint.previous.h5"])
def test_a_flipped_bit_anywhere_in_a_checkpoint_is_found(name, stopped):
    path = stopped / name
    size, rng = path.stat().st_size, np.random.default_rng(3)
    places = [0, 1, SEAL_BYTES - 1, SEAL_BYTES, SEAL_BYTES + 8, size - 1, *rng.integers(0, size, 60).tolist()]
    for place in places:
        flip(path, place, bit=place % 8)
        found = wrong(stopped)
        assert list(found) == [name], f"byte {place}"
        flip(path, place, bit=place % 8)
    assert wrong(stopped) == {}


def test_a_checkpoint_cut_short_is_found(finished):
    path = finished / "checkpoint.h5"
    content = path.read_bytes()
    for size in (0, 1, SEAL_BYTES, len(content) // 2, len(content) - 1):
        path.write_bytes(content[:size])
        assert list(wrong(finished)) == ["checkpoint.h5"], size
    path.write_bytes(content + b"\0")
    assert "it has " in wrong(finished)["checkpoint.h5"]


def test_damage_says_what_a_run_does_about_it(stopped):
    damage_an_array(stopped / "checkpoint.h5")
    text = wrong(stopped)["checkpoint.h5"]
    assert "its array state/traction is changed: wrong checksum of block 0 of 1" in text
    step = read_head(stopped / "checkpoint.previous.h5")["state"]["counters"]["steps"]
    assert text.endswith(f"the run goes on from the one before it, step {step}")
    damage_an_array(stopped / "checkpoint.previous.h5")
    found = wrong(stopped)
    assert list(found) == ["checkpoint.h5", "checkpoint.previous.h5"] and "--fresh" in found["checkpoint.h5"]


def test_the_one_before_is_not_needed(stopped):
    damage_an_array(stopped / "checkpoint.previous.h5")
    assert wrong(stopped)["checkpoint.previous.h5"].endswith("it is not needed: delete it")
    (stopped / "checkpoint.previous.h5").unlink()
    assert wrong(stopped) == {}
    (stopped / "checkpoint.h5").unlink()
    assert "nothing to go on from" in wrong(stopped)["checkpoint.h5"]


def test_a_finished_run_needs_none(finished):
    (finished / "checkpoint.h5").unlink()
    assert wrong(finished) == {}


def test_a_checkpoint_replaced_meanwhile_is_read_again(stopped, monkeypatch):
    whole, examine, calls = (stopped / "checkpoint.h5").read_bytes(), verify.examine, []

    def replaced_while_reading(path):
        calls.append(path.name)
        if calls.count(path.name) == 1 and path.name == "checkpoint.h5":
            damage_an_array(path)
            try:
                return examine(path)
            finally:
                (stopped / "new").write_bytes(whole)
                (stopped / "new").replace(path)
        return examine(path)

    monkeypatch.setattr(verify, "examine", replaced_while_reading)
    assert wrong(stopped) == {} and calls.count("checkpoint.h5") == 2


# -- tables ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["curve.csv", "energy.csv", "events.csv", "patches.csv", "sites.csv"])
def test_a_changed_row_is_found(name, finished):
    path = finished / name
    content = path.read_bytes()
    for place in (0, len(content) // 2, len(content) - 2):
        flip(path, place)
        assert "are not those that the" in wrong(finished)[name]
        flip(path, place)
    path.write_bytes(content[:-20])
    assert list(wrong(finished)) == [name]
    path.write_bytes(content + b"1,2,3\n")
    assert f"6 bytes after the end of the run; cut it back to {len(content)} bytes" in wrong(finished)[name]
    path.unlink()
    assert wrong(finished)[name].startswith("missing; put it back")


def test_rows_after_the_checkpoint_are_no_fault(stopped):
    with open(stopped / "curve.csv", "a", encoding="utf-8") as file:
        file.write("1.0,2.0\n")
    assert wrong(stopped) == {}
    assert any("8 bytes written since, not examined" in part.found for part in verify.verify(stopped))


def test_a_run_without_audit_has_no_energies_and_one_without_patches_no_sites(tmp_path):
    folder = run(tmp_path / "run", "output.energy=false", "output.patches=false", stop_after=5)
    assert wrong(folder) == {}
    assert not any((folder / name).exists() for name in ("energy.csv", "patches.csv", "sites.csv"))


# -- snapshots ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ARRAYS)
def test_a_flipped_bit_in_a_snapshot_is_found(name, finished):
    path = finished / "fields.h5"
    for frame in range(3):
        offset, size = place_of(finished, name, frame)
        for place in (offset, offset + size // 3, offset + size - 1):
            flip(path, place, bit=5)
            text = wrong(finished)["fields.h5"]
            assert text.startswith(f"changed: {name} of snapshot {frame}; ")
            flip(path, place, bit=5)
    assert wrong(finished) == {}


def noted(pieces, part, first):
    """The sum of a part, whose size is noted."""
    pieces.append(part.size)
    return whole_sum(part, first)


def test_arrays_are_read_in_pieces(finished, monkeypatch):
    """Whatever the size of the pieces, the sum is that of the whole array; no more than a piece is read at a time."""
    with open_serial(finished / "fields.h5", "r") as file:
        array = file["surface_displacement"]
        whole, side = whole_sum(array[1], 0), array.shape[2]
        for piece in (1, side + 1, 5 * side, side * side - 1, 10**6):
            pieces = []
            monkeypatch.setattr(verify, "PIECE", piece)
            monkeypatch.setattr(verify, "whole_sum", partial(noted, pieces))
            assert verify._sum_of(array, 1) == whole
            assert max(pieces) <= max(piece, side) and sum(pieces) == side * side


def test_lost_snapshots_are_found(finished):
    fields_layout.resize(finished / "fields.h5", layout_of(finished), 2)
    assert wrong(finished)["fields.h5"].startswith("has 2 snapshots, the checkpoint knows 3")
    (finished / "fields.h5").unlink()
    assert wrong(finished)["fields.h5"].startswith("missing, 3 snapshots were in it")


def test_a_structure_that_is_changed_is_found(finished):
    with h5py.File(finished / "fields.h5", "r+") as file:
        file["time"].resize(2, axis=0)
        file["x"][3] += 1e-9
    assert wrong(finished)["fields.h5"].startswith("can't be read: its structure is changed: time, x; ")


def test_snapshots_of_an_earlier_version_have_no_checksums(finished):
    with h5py.File(finished / "fields.h5", "r+") as file:
        del file["gap_checksum"]
    assert wrong(finished) == {}
    assert any("without checksums" in part.found for part in verify.verify(finished))


def test_a_file_that_is_none_is_found(finished):
    os.truncate(finished / "fields.h5", 1000)
    assert wrong(finished)["fields.h5"].startswith("can't be read: ")


def half_a_snapshot(folder):
    """What a process leaves that was killed while it added a snapshot."""
    path, layout = folder / "fields.h5", layout_of(folder)
    frames = fields_layout.count_frames(path, layout)
    size = fields_layout.reserve(path, layout.frame_bytes + 2**16)
    fields_layout.remember(path, layout, size)
    fields_layout.resize(path, layout, frames + 1)


def test_an_addition_that_did_not_end(finished):
    half_a_snapshot(finished)
    assert wrong(finished) == {
        "fields.h5.undo": "an addition to the snapshots did not end; the next start puts it right"
    }
    flip(finished / "fields.h5.undo", 500)
    assert "the snapshots can't be trusted; move both away" in wrong(finished)["fields.h5.undo"]


def test_an_addition_that_ended_within_the_structure(stopped):
    half_a_snapshot(stopped)
    with h5py.File(stopped / "fields.h5", "r+") as file:
        file["time"].resize(1, axis=0)
    assert list(wrong(stopped)) == ["fields.h5.undo"]
    parts = {part.path.name: part for part in verify.verify(stopped)}
    assert parts["fields.h5"].found == "not examined, as adding a snapshot has not ended"
    with locked(stopped):
        assert wrong(stopped) == {}


def test_an_addition_of_a_run_that_is_going_on_is_no_fault(stopped):
    half_a_snapshot(stopped)
    with locked(stopped):
        parts = {part.path.name: part for part in verify.verify(stopped)}
        assert all(part.fine for part in parts.values())
        assert parts["stopped"].found.startswith("in use by process ")
        assert parts["fields.h5"].found.endswith(", and 1 not examined")
        # What the checkpoint knows is examined all the same.
        flip(stopped / "fields.h5", place_of(stopped, "gap", 0)[0])
        assert wrong(stopped)["fields.h5"].startswith("changed: gap of snapshot 0; ")


def test_a_file_being_written_is_looked_at_again(stopped, monkeypatch):
    looks, snapshots = [], verify._snapshots

    def torn_at_first(*arguments):
        looks.append(1)
        if len(looks) == 1:
            raise OSError("bad object header")
        return snapshots(*arguments)

    monkeypatch.setattr(verify, "_snapshots", torn_at_first)
    monkeypatch.setattr(verify, "PAUSE", 0.0)
    assert wrong(stopped)["fields.h5"].startswith("can't be read: bad object header")
    looks.clear()
    with locked(stopped):
        assert wrong(stopped) == {} and len(looks) == 2


def test_a_run_on_another_host_is_in_use(stopped, monkeypatch):
    elsewhere = Holder("node17", 4711, "Slurm job 12", "2026-01-01 10:00:00", "me", 64, None)
    monkeypatch.setattr(run_lock, "holder", lambda folder: elsewhere)
    (stopped / "run.lock").write_text("{}")
    assert "process 4711 on node17, Slurm job 12" in next(verify.verify(stopped)).found


# -- the rest ----------------------------------------------------------------------------------------------------------


def test_scene_and_record_can_be_read(finished):
    (finished / "run.json").write_text("{")
    (finished / "scene.resolved.toml").write_text("= 1")
    found = wrong(finished)
    assert list(found) == ["scene.resolved.toml", "run.json"] and found["run.json"].startswith("damaged: ")
    for text in ('{"a": 1}', "[1]"):
        (finished / "run.json").write_text(text)
        assert wrong(finished)["run.json"].startswith("damaged: it does not say how a run has finished"), text


def test_folders_without_a_run(tmp_path):
    assert [part.found for part in verify.verify(tmp_path)] == ["no run yet"]
    (tmp_path / "letter.txt").write_text("Dear Sir")
    with pytest.raises(ResultError, match="not a results folder"):
        next(verify.verify(tmp_path))


def test_a_head_of_another_version_is_no_crash(stopped, monkeypatch):
    monkeypatch.setattr(verify, "examine", lambda path: {"pgfmd": "9.9", "state": {}})
    assert "of another version of pgfmd (9.9)" in wrong(stopped)["checkpoint.h5"]
    assert storage.CHECKPOINT_FILES[0] == "checkpoint.h5"


def test_the_command_ends_in_4_if_anything_is_wrong(stopped, finished, tmp_path, capsys):
    def called(*folders):
        with pytest.raises(SystemExit) as ended:
            cli.main(["verify", *map(str, folders)])
        return ended.value.code, capsys.readouterr()

    code, said = called(stopped, finished)
    assert (code, said.err) == (0, "") and all(line.startswith("OK   ") for line in said.out.splitlines())
    flip(finished / "curve.csv", 300)
    code, said = called(finished, stopped)
    failed = [line for line in said.out.splitlines() if line.startswith("FAIL ")]
    assert code == 4 and len(failed) == 1
    assert failed[0].startswith(f"FAIL {finished}/curve.csv: its first ") and "put the file back" in failed[0]
    # A folder that is none does not end it before the others.
    code, said = called(tmp_path / "nowhere", stopped)
    assert code == 4 and said.err == f"pgfmd: {tmp_path}/nowhere: no such folder\n" and "checkpoint.h5" in said.out


@pytest.mark.parametrize("name", ["time", "punch_position", "force", "label"])
def test_a_changed_number_or_label_of_a_snapshot_is_found(name, finished):
    with open_serial(finished / "fields.h5", "r+") as file:
        file[name][1] = file[name][0] if name == "label" else np.nextafter(file[name][1], 1.0)
    assert "changed: numbers or label of snapshot 1;" in wrong(finished)["fields.h5"]
