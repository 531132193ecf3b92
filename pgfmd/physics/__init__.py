"""The physical model: elastomer, rheology, adhesion, the punch's face, the loading programme. Plain NumPy, no MPI."""
