"""Diagnosis of measured walking: the ground reaction that a motion requires, against the measured one."""
