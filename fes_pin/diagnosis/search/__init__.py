"""Which sets of causes are fitted, and how."""
