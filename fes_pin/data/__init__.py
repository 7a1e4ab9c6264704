"""Studies and trials: measured data in; the only place with degrees, microseconds and milliamperes."""
