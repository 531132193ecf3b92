"""Checkpoints of runs, continuing from them, and what may change in between."""
