"""Numbers of a scene from a measured curve: least squares over runs. No MPI."""
