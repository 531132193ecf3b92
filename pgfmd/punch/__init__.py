"""The face of a scene's punch as an array, as a solid to be printed, and as a file. No MPI."""
