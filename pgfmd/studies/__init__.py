"""Studies: many runs of one scene with other values, side by side or as an array of batch jobs; convergence. No MPI."""
