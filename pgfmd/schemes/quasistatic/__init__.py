"""Infinitely slow loading: a path of equilibria, and the jumps between them."""

from pgfmd.schemes.entry import SchemeEntry

ENTRY = SchemeEntry(
    name="quasistatic",
    meaning="infinitely slow, a path of equilibria with jumps",
    timeless=True,
    has_machine=True,
    precisions_with_spring=("double", "mixed"),
    has_modulus=True,
    only_double="quasi-static paths in mixed precision have been measured on small grids only",
    whole_only="a path of equilibria may become lopsided",
    unread={"solver.order": "it follows equilibria", "drive.dwell": "time does not count"},
    build="pgfmd.schemes.quasistatic.plugin:build",
    memory="pgfmd.schemes.quasistatic.plugin:memory",
    warm_up="pgfmd.schemes.quasistatic.plugin:warm_up",
)
