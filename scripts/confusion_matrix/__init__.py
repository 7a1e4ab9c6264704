"""Studies that hide a known cause, made without the engine, and how often the diagnosis names it."""
