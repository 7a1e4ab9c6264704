"""Figures, the report, the meshcat viewer; they only read results."""
