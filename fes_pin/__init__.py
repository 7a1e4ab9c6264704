"""Functional electrical stimulation on Pinocchio: simulate, diagnose, extend, control."""

__version__ = "0.1.0"
