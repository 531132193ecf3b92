"""The machine: MPI launchers, processes, signals, time limits, the lock of a folder, and the checks of `doctor`."""
