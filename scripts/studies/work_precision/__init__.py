"""What an error costs with each scheme, and how large each kind of error is."""
