"""One question for every study: the rig says which diagnosis answers."""
