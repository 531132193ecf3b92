"""Files of a results folder: what they look like inside, checksums, and writing that a crash can't spoil."""
