"""What mixed precision changes in the results, and what it saves."""
