"""What only has the name of a file is refused, unfinished files can't be foreseen, and what a file system can't do."""

import errno
import os
import shutil
import stat
from pathlib import Path
from types import SimpleNamespace

import pytest
from mpi4py import MPI

from pgfmd import cli
from pgfmd.errors import ResultError
from pgfmd.files import regular_files, storage
from pgfmd.files.regular_files import bring_to_disk, remove_unfinished, temporary_name_for, write_atomically, write_new
from pgfmd.host.mounts import has_common_locks
from pgfmd.host.run_lock import LOCK_FILE, RunLock
from pgfmd.restart.checkpoint_policy import Timing
from pgfmd.restart.checkpoints import Checkpoints, Saved
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene
from tests.unit.small_runs import SCENE, run

pytestmark = pytest.mark.timeout(60)
NAMES = ("curve.csv", "run.json", "checkpoint.h5", "checkpoint.previous.h5", "fields.h5", "fields.h5.undo", "energy.csv",
         "scene.resolved.toml", "analysis.json", LOCK_FILE)  # fmt: skip
KINDS = {
    "a FIFO": os.mkfifo,
    "a folder": os.mkdir,
    "a symbolic link to nothing": lambda path: os.symlink("/nonexistent/x", path),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished run."""
    return run(tmp_path_factory.mktemp("whole") / "run", "solver.max_steps=3", "output.snapshots=[]")


def start(folder, say=lambda line: None, every=600.0):
    source, *changes = SCENE
    return run_scene(load_scene(source, changes), MPI.COMM_SELF, folder, say, Options(timing=Timing(every)))


def refused_by(capsys, *command):
    with pytest.raises(SystemExit) as caught:
        cli.main([*map(str, command)])
    assert caught.value.code == 4
    return capsys.readouterr().err


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_file_is_refused_by_all_who_read_or_write_it(kind, whole, tmp_path, capsys):
    for name in NAMES:
        folder = tmp_path / name.replace(".", "-")
        shutil.copytree(whole, folder)
        (folder / name).unlink(missing_ok=True)
        KINDS[kind](folder / name)
        # For who writes, a link is one wherever it leads.
        said = f"{folder / name}: is {kind.removesuffix(' to nothing')}"
        with pytest.raises(ResultError, match=f"{said}.*move it away"):
            start(folder)
        commands = ("status", "verify", "plot", "analyse") if name != LOCK_FILE else ("status", "verify")
        for command in commands:
            text = refused_by(capsys, command, folder)
            assert said in text and text.count("pgfmd:") == 1, (command, name)
        assert not stat.S_ISREG(os.lstat(folder / name).st_mode)


def test_a_link_to_a_file_is_read_but_never_written_through(whole, tmp_path):
    victim = tmp_path / "victim"
    for name in ("curve.csv", "run.json", "checkpoint.h5"):
        folder = tmp_path / name.replace(".", "-")
        shutil.copytree(whole, folder)
        shutil.move(folder / name, victim)
        (folder / name).symlink_to(victim)
        before = victim.read_bytes()
        with pytest.raises(ResultError, match=f"{name}: is a symbolic link, not a file"):
            start(folder)
        if name != "checkpoint.h5":
            with pytest.raises(SystemExit) as caught:
                cli.main(["status", str(folder)])
            assert caught.value.code == 0
        assert victim.read_bytes() == before and (folder / name).is_symlink()


def test_what_is_no_file_is_moved_aside_by_a_fresh_start(tmp_path):
    os.mkfifo(tmp_path / "curve.csv")
    (tmp_path / "fields.h5").symlink_to("/nonexistent/x")
    moved = storage.set_aside(tmp_path)
    assert sorted(os.listdir(moved)) == ["curve.csv", "fields.h5"] and os.listdir(tmp_path) == ["previous-1"]


def test_names_of_unfinished_files_are_not_to_be_foreseen(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    for name in ("checkpoint.h5", "run.json", "fields.h5.undo", "scene.resolved.toml"):
        (tmp_path / f"{name}.tmp").symlink_to(victim)
    start(tmp_path)
    assert victim.read_text() == "precious"
    assert temporary_name_for(victim) != temporary_name_for(victim)
    link = tmp_path / "link"
    link.symlink_to(victim)
    with pytest.raises(ResultError, match="link: is a symbolic link"):
        write_atomically(link, b"other")
    assert victim.read_text() == "precious"


def test_a_name_that_is_taken_is_not_written_to(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / "guessed").symlink_to(victim)
    monkeypatch.setattr(regular_files, "temporary_name_for", lambda path: tmp_path / "guessed")
    with pytest.raises(FileExistsError):
        write_atomically(tmp_path / "run.json", b"other")
    assert victim.read_text() == "precious"


def test_a_new_file_is_whole_or_not_there(tmp_path, monkeypatch):
    with pytest.raises(UnicodeEncodeError):
        write_new(tmp_path / "scene.toml", "title = 'x'\n" * 10_000 + "\udcff")
    assert not os.listdir(tmp_path)
    write_new(tmp_path / "scene.toml", "one")
    with pytest.raises(FileExistsError):
        write_new(tmp_path / "scene.toml", "two")
    assert (tmp_path / "scene.toml").read_text() == "one"
    # A kill while it is written leaves nothing of this name.
    seen = []
    monkeypatch.setattr(os, "fsync", lambda handle: seen.append(sorted(path.name for path in tmp_path.glob("*.toml"))))
    write_new(tmp_path / "new.toml", "three")

    def refuse(*names):
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    write_new(tmp_path / "other.toml", "four")
    assert seen == [["scene.toml"], ["new.toml", "scene.toml"]]
    assert sorted(os.listdir(tmp_path)) == ["new.toml", "other.toml", "scene.toml"]


def test_only_own_regular_files_that_nobody_finishes_are_removed(tmp_path, monkeypatch):
    def left(name, age=0.0):
        path = tmp_path / name
        path.write_text("")
        os.utime(path, (path.stat().st_mtime - age,) * 2)
        return name

    code = "0123456789abcdef" * 2
    gone = {left(f"checkpoint.h5.{code}.tmp"), left("run.json.tmp"), left(f"curve.png.{code}.tmp", 700.0)}
    kept = {left(f"curve.png.{code[::-1]}.tmp"), left("notes.tmp", 700.0), left(f"run.json.{code[1:]}.tmp", 700.0)}
    (tmp_path / f"energy.csv.{code}.tmp").symlink_to(tmp_path / "notes.tmp")
    (tmp_path / f"fields.h5.{code}.tmp").mkdir()
    kept |= {f"energy.csv.{code}.tmp", f"fields.h5.{code}.tmp"}
    monkeypatch.setattr(regular_files.os, "geteuid", lambda: os.getuid() + 1)
    remove_unfinished(tmp_path, storage.RESULTS)
    assert set(os.listdir(tmp_path)) == gone | kept
    monkeypatch.undo()
    remove_unfinished(tmp_path, storage.RESULTS)
    assert set(os.listdir(tmp_path)) == kept


# -- a folder that is renamed ------------------------------------------------------------------------------------------


def test_a_lock_knows_whether_it_is_still_there(tmp_path):
    folder, moved = tmp_path / "out", tmp_path / "moved"
    folder.mkdir()
    lock = RunLock.acquire(folder, 1)
    lock.require_held()
    folder.rename(moved)
    with pytest.raises(ResultError, match=f"{folder}: no longer .* there is no run.lock.*own folder is {moved} now"):
        lock.require_held()
    folder.mkdir()
    other = RunLock.acquire(folder, 1)
    with pytest.raises(ResultError, match=r"its run\.lock is another one's"):
        lock.require_held()
    lock.release()
    other.require_held()
    other.release()


@pytest.mark.parametrize("what", ["checkpoints", "snapshots"])
def test_a_run_never_writes_into_the_folder_that_took_its_name(what, tmp_path, monkeypatch):
    folder, moved = tmp_path / "out", tmp_path / "moved"
    source, *changes = SCENE

    def say(line):
        if line.startswith("checkpoint") and not moved.exists():
            folder.rename(moved)
            folder.mkdir()
            for name in (LOCK_FILE, "checkpoint.h5", "run.json", "fields.h5", "curve.csv"):
                (folder / name).write_text("another run's")

    if what == "snapshots":
        # They alone find out.
        monkeypatch.setattr(Checkpoints, "save", lambda self, head, arrays: Saved(0, 0.0))
    scene = load_scene(source, changes)
    with pytest.raises(ResultError, match=f"{folder}: no longer the folder that this run has locked"):
        run_scene(scene, MPI.COMM_SELF, folder, say, Options(timing=Timing(0.0)))
    assert {path.read_text() for path in folder.iterdir()} == {"another run's"} and len(os.listdir(folder)) == 5
    assert not list(moved.glob("*.tmp"))
    # Where it is now it goes on.
    assert what == "snapshots" or run_scene(scene, MPI.COMM_SELF, moved, lambda line: None)["finished"] == "detached"


# -- what file systems can't do ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", [errno.EINVAL, errno.ENOTSUP, errno.EBADF])
def test_a_folder_that_cannot_be_brought_to_the_disk_does_no_harm(code, tmp_path, monkeypatch):
    def refuse(handle):
        raise OSError(code, os.strerror(code))

    file = tmp_path / "file"
    file.write_text("")
    monkeypatch.setattr(os, "fsync", refuse)
    bring_to_disk(tmp_path)
    with pytest.raises(OSError, match=os.strerror(code)):
        bring_to_disk(file)
    code = errno.EIO
    with pytest.raises(OSError, match="Input/output"):
        bring_to_disk(tmp_path)


def test_free_space_that_is_not_known_stops_no_run(tmp_path, monkeypatch):
    monkeypatch.setattr(storage.shutil, "disk_usage", lambda folder: SimpleNamespace(total=0, free=0))
    storage.require_space(tmp_path, 10**9, 0)
    monkeypatch.setattr(storage.shutil, "disk_usage", lambda folder: SimpleNamespace(total=10**12, free=0))
    with pytest.raises(ResultError, match="only 0 GB are free"):
        storage.require_space(tmp_path, 10**9, 0)


@pytest.mark.parametrize("point", ["/mnt/Müller", "/mnt/研究", "/mnt/my\\040data", "/mnt/a\\134b"])
def test_mount_points_may_have_any_letters(point):
    folder = Path(point.replace("\\040", " ").replace("\\134", "\\")) / "out"
    root = "22 1 253:0 / / rw - ext4 /dev/vda rw\n"
    assert has_common_locks(folder, root)
    assert not has_common_locks(folder, root + f"40 22 0:50 / {point} rw - fuse.sshfs me@host:/x rw\n")
