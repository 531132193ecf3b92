"""What a scene will cost, what to warn of before it runs, and how far a run has come. No MPI."""
