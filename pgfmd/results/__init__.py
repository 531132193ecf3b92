"""Results folders: reading, state of a run, numbers, verification. No MPI; works while the run is going on."""

from .reading import Results, load

__all__ = ["Results", "load"]
