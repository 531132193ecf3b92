"""The laws of adhesion, one a module, listed in registry.py. Plain NumPy: solver/inlined_laws.py compiles them."""
