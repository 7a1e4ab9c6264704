"""Walking that is made up, without the engine that diagnoses it."""
