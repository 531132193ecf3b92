"""Pictures of results folders and of rheologies. Reads files only; no MPI."""
