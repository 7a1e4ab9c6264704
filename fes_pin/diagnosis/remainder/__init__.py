"""What is left after the causes: one test a file."""
