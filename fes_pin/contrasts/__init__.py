"""Contrasts: changes between groups of trials of one rig."""
