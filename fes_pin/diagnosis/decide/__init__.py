"""Decisions about the causes that are named, and their evidence."""
