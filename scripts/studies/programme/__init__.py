"""Programmes of steps: the dynamic stiffness of a flat punch, and which programmes a run gets through."""
