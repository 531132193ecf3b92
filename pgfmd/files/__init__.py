"""Files of a results folder: formats, checksums, and writing that survives a crash; text files of users."""
