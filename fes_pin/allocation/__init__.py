"""From joint torques to pulse widths: programs, certificates, what can be attained."""
