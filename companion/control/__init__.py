"""Who has the aircraft: the state machine, pilot overrides, take-over, release and rejoin."""
