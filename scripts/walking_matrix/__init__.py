"""Walks that hide a known cause, made without the engine, and how often each is named."""
