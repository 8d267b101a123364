"""Joint avoidance among the members of a group."""
