"""From measured moduli to a rheology: dynamic mechanical analysis, shifts with temperature, Prony series. No MPI."""
