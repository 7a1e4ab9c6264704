"""Studies and trials: measured data in, and nothing else; the only place with degrees, microseconds and milliamperes."""
