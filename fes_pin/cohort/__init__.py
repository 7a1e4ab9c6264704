"""Many studies at once: diagnosed side by side, kept as they come, and pooled."""
