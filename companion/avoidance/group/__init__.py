"""Joint avoidance for the members of a formation."""
