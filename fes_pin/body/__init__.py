"""The walking body on Pinocchio: A, B, C, modes, controllability."""
