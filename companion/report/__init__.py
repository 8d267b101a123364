"""The report of a flight: one page for whoever wants to know what happened."""
