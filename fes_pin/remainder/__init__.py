"""Tests of lack of fit, one a file."""
