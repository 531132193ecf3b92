"""The surface on its grid, shared out over the ranks: transforms, implicit steps, control of steps, the state and the
loop."""
