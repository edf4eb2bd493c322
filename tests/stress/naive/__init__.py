"""The usual methods in their plainest form, to measure what they lose. None of this is used by the engine."""
