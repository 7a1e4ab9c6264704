"""Models of the literature on a study's trials, ranked."""
