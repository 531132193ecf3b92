"""What a run costs in time and memory, and what each way to save some of it saves."""
