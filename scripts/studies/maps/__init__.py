"""How a height map lies under the punch."""
