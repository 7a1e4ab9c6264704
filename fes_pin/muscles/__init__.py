"""Nerves, the muscles they drive, moment arms and recruitment."""
