"""Fits of models to trials, their noise and their uncertainty."""
