"""Inference, which knows no rig and no body: levels, tests, families, and the search over sets of candidates."""
