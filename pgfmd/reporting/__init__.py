"""Pages for a browser about runs and studies: what is shown, and how it becomes one file. Reads files only, no MPI."""
