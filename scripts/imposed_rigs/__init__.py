"""Rigs that are made to follow a motion, with known causes hidden, and how often each is named."""
