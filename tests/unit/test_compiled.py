"""Compiled kernels are kept where that works, and no cache stops a run."""

from __future__ import annotations

import errno
import os
import tempfile

import pytest
from numba.core import caching, config

from pgfmd.solver import compiled

SOURCE = """
from pgfmd.solver.compiled import compiled

@compiled()
def double(x):
    return 2.0 * x
"""


@pytest.fixture
def world(tmp_path, monkeypatch):
    """A folder with a kernel's source, caches and temporary folder below it, and what is told."""
    told = []
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setattr(compiled, "_notes", {})
    monkeypatch.setattr(compiled, "_listener", told.append)
    (tmp_path / "kernel.py").write_text(SOURCE)
    return tmp_path, told


def kernel(folder):
    """The kernel as a new process sees it, called once; whether it came from a cache."""
    path, found = folder / "kernel.py", {}
    exec(compile(path.read_text(), str(path), "exec"), found)
    assert found["double"](2.5) == 5.0
    return sum(found["double"].stats.cache_hits.values()) == 1


def forbid(folder):
    """No folder of numba's can be made: root may write anywhere, but not below a file."""
    for name in ("cache", "home", "__pycache__"):
        (folder / name).write_text("in the way")


def test_a_kernel_is_kept_and_found_again(world):
    folder, told = world
    assert [kernel(folder) for _ in range(2)] == [False, True]
    assert not told and not list((folder / "temporary").iterdir()) and list((folder / "cache").rglob("*.nbc"))


def test_a_kernel_is_compiled_anew_when_any_kernel_changes(world, monkeypatch):
    folder, _ = world
    kernel(folder)
    monkeypatch.setattr(compiled, "_sources", lambda: "of another kernel, which this one may have compiled in")
    assert [kernel(folder) for _ in range(2)] == [False, True]


@pytest.mark.parametrize(("ending", "size"), [("nbi", 0), ("nbi", 100), ("nbc", 0), ("nbc", 1000)])
def test_half_a_file_is_compiled_anew(world, ending, size):
    folder, told = world
    kernel(folder)
    (file,) = (folder / "cache").rglob(f"*.{ending}")
    os.truncate(file, size)
    assert [kernel(folder) for _ in range(2)] == [False, True]
    assert len(told) == 1 and told[0].startswith(f"note: damaged kernels in {folder}/cache")


def test_without_a_place_of_its_own_it_goes_to_the_temporary_folder(world):
    folder, told = world
    forbid(folder)
    assert [kernel(folder) for _ in range(2)] == [False, True]
    assert len(told) == 1 and "NUMBA_CACHE_DIR" in told[0] and str(compiled.temporary_folder()) in told[0]
    assert compiled.temporary_folder().stat().st_mode & 0o777 == 0o700


def test_a_full_disk_is_left_for_the_temporary_folder(world, monkeypatch):
    folder, told = world
    write = caching.IndexDataCacheFile._save_data

    def full(self, name, data):
        if str(folder / "cache") in self._cache_path:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(self, name, data)

    monkeypatch.setattr(caching.IndexDataCacheFile, "_save_data", full)
    assert [kernel(folder) for _ in range(2)] == [False, True]
    assert len(told) == 1 and f"{folder}/cache" in told[0] and "No space left on device" in told[0]


@pytest.mark.parametrize("why", ["a file", "open to others"])
def test_code_is_not_loaded_from_a_folder_that_others_may_write(world, why):
    folder, told = world
    forbid(folder)
    private = compiled.temporary_folder()
    if why == "a file":
        private.write_text("in the way")
    else:
        private.mkdir()
        private.chmod(0o777)
    assert [kernel(folder) for _ in range(2)] == [False, False]
    assert len(told) == 1 and "each start compiles anew" in told[0]


def test_the_place_is_that_of_the_solvers_kernels():
    from pgfmd.solver import kernels

    assert str(compiled.place()) == kernels.dot.stats.cache_path
