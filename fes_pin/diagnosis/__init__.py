"""What a simulation gets wrong, and its cause by name."""
