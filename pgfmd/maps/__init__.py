"""Height maps as people have them: their files, units, missing pixels and tilts. No MPI."""
