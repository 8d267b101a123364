"""The flight report: one page about what happened in a flight."""
