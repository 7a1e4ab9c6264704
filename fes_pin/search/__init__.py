"""Sets of causes: their candidates, their score tests and their fits."""
