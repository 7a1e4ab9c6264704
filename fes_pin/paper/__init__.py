"""What is section II's own: eq. (1) in plain numbers, gain and time constant pulse by pulse, the passive antagonist."""
