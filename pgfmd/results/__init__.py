"""Results folders: read back, listed, checked, and how a run stands. No MPI; works while the run goes on."""

from .reading import Results, load

__all__ = ["Results", "load"]
