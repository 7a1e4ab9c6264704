"""Trials before a search: measured, in parts, and dealt to folds."""
