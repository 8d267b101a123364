"""The flight report: one page about a flight."""
