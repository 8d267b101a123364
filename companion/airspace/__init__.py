"""Where the aircraft may fly: fences, obstacles and height limits."""
