"""Models: stages, rigs, effects; expressions compiled to machine code."""
