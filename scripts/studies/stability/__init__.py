"""Which scenes a run gets through, from one end of every key to the other."""
