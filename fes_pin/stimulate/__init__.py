"""Nerves, allocation of joint torques to pulse widths, control."""
