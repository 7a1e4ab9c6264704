"""Rigs whose hidden causes are large and whose start values are far off, by scipy's integrators."""
