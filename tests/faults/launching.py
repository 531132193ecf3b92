"""What tests of whole processes share: an environment in which mpirun works anywhere, whatever has started the tests."""

import os
import subprocess
import time
from pathlib import Path

from pgfmd.host.launchers import environment_without

ENVIRONMENT = {name: value for name, value in environment_without().items() if not name.startswith("SLURM_")} | {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMP_NUM_THREADS": "1",
    # Ranks that wait leave their core to others: cores are few where tests run.
    "OMPI_MCA_mpi_yield_when_idle": "1",
    # All ranks work, also where there are fewer cores.
    "PGFMD_ALL_RANKS": "1",
    # Shorter than in scripts/environment, for tests that end in another code than 0.
    "OMPI_MCA_odls_base_sigkill_timeout": "1",
}


def held_at(step: int) -> dict[str, str]:
    """The environment of runs that wait at that step of theirs until a signal has come to every rank."""
    path = [str(Path(__file__).with_name("held")), *filter(None, [ENVIRONMENT.get("PYTHONPATH")])]
    return ENVIRONMENT | {"HELD_AT_STEP": str(step), "PYTHONPATH": os.pathsep.join(path)}


def wait_for_rows(folder: Path, rows: int, process: subprocess.Popen) -> None:
    """Until a live run has written so many lines of its curve."""
    curve, latest = folder / "curve.csv", time.monotonic() + 60.0
    while not curve.is_file() or curve.read_bytes().count(b"\n") < rows:
        assert time.monotonic() < latest and process.poll() is None
        time.sleep(0.01)
