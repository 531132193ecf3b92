"""A run looked at while it goes on, in a terminal or a browser. Only reads, and never disturbs the run. No MPI."""
