"""Inference without knowledge of rigs or bodies: levels, tests, families, search over sets of candidates, verdict."""
