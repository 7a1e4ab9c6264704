"""Least squares of low-passed inverse dynamics: an estimator of driven joints whose efforts were recorded."""
