"""Infinitely slow loading: a path of equilibria, and the jumps between them."""
