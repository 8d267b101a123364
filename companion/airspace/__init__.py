"""The airspace that the aircraft may use: fences, obstacles and height limits."""
