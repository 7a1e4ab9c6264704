"""Methods of the paper's section II: eq. (1) in plain numbers, gain and time constant by pulse, passive antagonist."""
