"""What a checkpoint costs, and whether a run that is killed goes on as if nothing had happened."""
