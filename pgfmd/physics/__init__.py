"""The laws: elastomer, rheology, adhesion, the punch's surface and the loading programme. Plain NumPy, no MPI."""
