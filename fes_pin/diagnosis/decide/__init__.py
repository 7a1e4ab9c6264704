"""What is claimed, and on what evidence."""
