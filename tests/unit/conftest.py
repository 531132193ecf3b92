"""Copies, for tests that change them, of the runs that a module has in its fixture `runs`."""

import shutil

import pytest


@pytest.fixture
def finished(runs, tmp_path):
    return shutil.copytree(runs / "finished", tmp_path / "finished")


@pytest.fixture
def stopped(runs, tmp_path):
    return shutil.copytree(runs / "stopped", tmp_path / "stopped")
