"""Position control of the ankle by pulse width, its observer and its limits."""
