"""Studies that hide known causes, what the package answers, and how often that is right; see `scripts/accuracy`."""
