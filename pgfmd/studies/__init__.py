"""Studies: many runs of one scene with different values, in parallel or as an array of batch jobs; convergence. No
MPI."""
