"""Contracts that several tests check."""

# Keys of the report of `companion-sim paper`, for every method.
MEASURES = {
    "safety_value",
    "heading_effort",
    "speed_effort",
    "min_separation",
    "collisions",
    "arrived",
    "steps",
    "path_ratio",
}
