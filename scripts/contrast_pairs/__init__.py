"""Groups of trials between which something was changed on purpose, and how often that is named."""
