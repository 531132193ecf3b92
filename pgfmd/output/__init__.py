"""What a run writes: observers and their files. Collective."""
