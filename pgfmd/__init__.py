"""pgfmd."""
