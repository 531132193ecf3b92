"""A run and its machine: processes, signals, limits of time, the lock on a folder, and whether MPI works here."""
