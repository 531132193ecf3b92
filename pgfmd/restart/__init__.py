"""Runs that survive: checkpoints, resuming from them, the lock on a results folder, signals and limits of time."""
