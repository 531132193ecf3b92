"""The doctor's verdicts: FAIL for what stops a run, NOTE for what it does without; two MPIs that don't match."""

from __future__ import annotations

import sys

import h5py
import pytest

from pgfmd.host import doctor, ranks
from pgfmd.solver import compiled

MPICH = """#!/bin/sh
[ "$1" = --version ] && { echo "HYDRA build details:"; echo "    Version:    4.0.2"; exit; }
shift 2
"""


@pytest.fixture
def other_mpirun(tmp_path, monkeypatch):
    """Puts an mpirun of another MPI first on PATH, which does what is asked with the rest of its command line."""

    def make(action):
        path = tmp_path / "mpirun"
        path.write_text(MPICH + action)
        path.chmod(0o755)
        monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
        doctor._trouble_with_mpirun.cache_clear()
        return path

    yield make
    doctor._trouble_with_mpirun.cache_clear()


@pytest.mark.parametrize(
    ("action", "seen"),
    [
        ('"$@"; exec "$@"', "2 processes see 1 and 1 ranks"),
        ("echo unable to parse hostfile >&2; exit 7", "two ranks ended with code 7: unable to parse hostfile"),
    ],
)
def test_two_mpis_that_do_not_belong_together_are_named(other_mpirun, action, seen):
    path = other_mpirun(action)
    with pytest.raises(ranks.Trouble) as caught:
        doctor._mpirun()
    own = ranks.mpi_of_mpi4py()
    assert ranks.maker_of(own) != "MPICH", "the test's other MPI is this machine's own"
    assert str(caught.value).startswith(f"{path} is of MPICH 4.0.2, mpi4py of {own}: ") and seen in str(caught.value)
    assert caught.value.stops and "first on PATH" in caught.value.cure
    # What one rank needs is fine, and is said to be.
    assert doctor._transform().startswith("on 1 rank as NumPy's")


def test_what_runs_do_without_is_a_note(monkeypatch):
    monkeypatch.setattr(h5py, "get_config", lambda: type("Config", (), {"mpi": False}))
    monkeypatch.setattr(compiled, "place", lambda: None)
    monkeypatch.setattr(doctor, "CHECKS", {name: doctor.CHECKS[name] for name in ("parallel HDF5", "compiled kernels")})
    found = list(doctor.examine())
    assert all(finding.fine and str(finding).startswith(f"NOTE {finding.name}: ") for finding in found)
    assert "HDF5_MPI=ON" in found[0].cure and "NUMBA_CACHE_DIR" in found[1].cure


def test_a_library_that_does_not_load_is_named_in_the_cure(monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    monkeypatch.setattr(doctor, "CHECKS", {"parallel HDF5": doctor.CHECKS["parallel HDF5"]})
    (finding,) = doctor.examine()
    assert not finding.fine and finding.cure.endswith("--force-reinstall h5py") and str(finding).startswith("FAIL ")


def test_of_a_traceback_the_error_is_told():
    text = 'Traceback (most recent call last):\n  File "x.py", line 1\nOSError: [Errno 28] No space left\n-----\n'
    assert ranks._gist(text) == "OSError: [Errno 28] No space left"
    assert ranks._gist("-----\nno slots\nmore\n") == "no slots" and ranks._gist("") == "no message"
