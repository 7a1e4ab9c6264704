"""Measured walking against the model: what ground reaction a motion requires, and what the model gets wrong."""
