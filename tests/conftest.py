"""What all tests share: fixed examples for hypothesis, counts for `scripts/test`, and an end for tests that would hang.

Under `mpirun -n N pytest --with-mpi` every rank runs every test. A test that fails on one rank alone may leave the
others waiting for it. So after each test the ranks compare notes: failed everywhere, the run goes on; failed on some, or
no answer from the others for a while, the failing rank prints its report and ends the whole job.
"""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("pgfmd", derandomize=True, database=None, deadline=None)
settings.load_profile("pgfmd")

PATIENCE = 15.0
"""Seconds that a rank on which a test failed waits for the others to end this test."""


def pytest_addoption(parser):
    parser.addoption("--counts", metavar="FILE", help="write the numbers of passed, failed and skipped tests to FILE")


def pytest_configure(config):
    comm = None
    if config.getoption("with_mpi", False):
        from mpi4py import MPI

        comm = MPI.COMM_WORLD.Dup()
    counts = config.getoption("--counts")
    config.pluginmanager.register(Bookkeeper(comm, Path(counts) if counts else None), "pgfmd-bookkeeper")
    if comm is not None and comm.rank > 0:
        config.option.verbose = -3
        config.option.no_header = config.option.no_summary = True


class Bookkeeper:
    """Counts the tests, and under MPI ends the job where a failure would leave ranks waiting."""

    def __init__(self, comm, counts: Path | None):
        self.comm, self.counts = comm, counts
        self.rank, self.size = (comm.rank, comm.size) if comm is not None else (0, 1)
        self.outcomes: dict[str, str] = {}
        self.collection_errors = 0
        self.failed_here = False
        self.watchdog: threading.Timer | None = None

    def pytest_report_teststatus(self, report):
        """Other ranks than the first draw no dots."""
        return (report.outcome, "", "") if self.rank > 0 else None

    def pytest_collectreport(self, report):
        if report.failed:
            self.collection_errors += 1
            if self.size > 1:
                self.abort(str(report.longrepr))

    def pytest_runtest_logreport(self, report):
        """A test counts once: failed if any of its three phases failed, skipped if one was skipped, else passed."""
        worst = self.outcomes.get(report.nodeid, "passed")
        if report.failed or (report.skipped and worst == "passed"):
            self.outcomes[report.nodeid] = report.outcome
        else:
            self.outcomes.setdefault(report.nodeid, "passed")
        if report.failed and self.size > 1:
            self.failed_here = True
            text = f"{report.nodeid} ({report.when})\n{report.longreprtext}"
            if self.rank > 0:
                self.say(text)
            if self.watchdog is None:
                self.watchdog = threading.Timer(PATIENCE, self.abort, [text])
                self.watchdog.daemon = True
                self.watchdog.start()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        yield
        if self.rank == 0:
            # Now, not at the end, which a job that is killed never sees.
            self.write()
        if self.size == 1:
            return
        failures = self.comm.allreduce(int(self.failed_here))
        if self.watchdog is not None:
            self.watchdog.cancel()
        if 0 < failures < self.size:
            # Messages of this test may still be under way: nothing after it could be trusted.
            self.abort(f"{item.nodeid} failed on {failures} of {self.size} ranks")
        self.failed_here, self.watchdog = False, None

    def pytest_sessionfinish(self):
        if self.rank == 0:
            self.write()

    def write(self) -> None:
        """Leaves the counts in a file, one line: passed failed skipped."""
        if self.counts is not None:
            found = list(self.outcomes.values())
            failed = found.count("failed") + self.collection_errors
            self.counts.write_text(f"{found.count('passed')} {failed} {found.count('skipped')}\n", encoding="utf-8")

    def say(self, text: str) -> None:
        """Past pytest's capture, which owns stdout and stderr while a test runs."""
        os.write(sys.__stderr__.fileno(), f"[rank {self.rank}] {text}\n".encode())

    def abort(self, text: str) -> None:
        """Ends all ranks."""
        self.say(f"{text}\n[rank {self.rank}] ending all ranks; the tests after this one were not run")
        self.comm.Abort(1)
