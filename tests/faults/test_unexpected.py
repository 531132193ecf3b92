"""An error that nobody expected, on every rank: one block, and the job ends."""

import subprocess
import sys

import pytest

from pgfmd.host import launch
from tests.faults.launching import ENVIRONMENT

pytestmark = pytest.mark.skipif(launch.launched()[0] > 1, reason="starts its own ranks")

ALL_FAIL = """
from pgfmd.host import faults, launch

faults.expect(["run", "tri-tack"])
comm = launch.world()
with launch.guarded(comm):
    raise {}
"""


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        ("KeyError('depth')", 1, "this is a fault of pgfmd. Please report it with this block:"),
        ("MemoryError", 3, "the memory is not enough: take a smaller grid"),
    ],
)
def test_ranks_that_fail_alike_speak_once(error, code, told):
    done = subprocess.run(
        ["mpirun", "-n", "2", sys.executable, "-c", ALL_FAIL.format(error)],
        env=ENVIRONMENT, text=True, capture_output=True, timeout=60.0,
    )  # fmt: skip
    assert done.returncode == code and done.stderr.count(told) == done.stderr.count("pgfmd: ") == 1, done.stderr
    assert done.stderr.count("Traceback") == (error != "MemoryError")
    assert ("asked for: pgfmd run tri-tack (rank 0 of 2)" in done.stderr) == (error != "MemoryError")
