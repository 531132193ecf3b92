"""The figures of docs/evidence/validation.md: one module a family of closed forms, one function a figure.

Each function takes `quick` (small grids) and returns a figure and the lines of its table, all of them from real runs.
Shared with the tests: the runs, spectra and dense equations of tests/physics.
"""
