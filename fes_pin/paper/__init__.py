"""What is section II's own: gain and time constant pulse by pulse, error region, antagonist, twins."""
