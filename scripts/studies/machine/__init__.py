"""What a machine that gives way does to a tack test, and what a correction afterwards does not put right."""
