"""Rigs that a controller drives, with known causes hidden, and how often each is named."""
