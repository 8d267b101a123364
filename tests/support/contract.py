"""What others rely on, and more than one test looks at."""

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
