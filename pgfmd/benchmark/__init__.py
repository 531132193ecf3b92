"""How fast this machine is, and what an error costs."""
