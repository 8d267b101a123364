"""Configuration: YAML to frozen dataclasses; every error has file, line and key."""

from companion.config.description import describe, reference
from companion.config.examples import example, example_names
from companion.config.loader import line_of, load_config
from companion.config.obstacle_files import load_obstacles
from companion.config.saved_settings import SavedSettings, apply_saved, describe_saved, load_saved
from companion.config.schema import Config, RecordingParams, WebParams

__all__ = [
    "Config",
    "RecordingParams",
    "SavedSettings",
    "WebParams",
    "apply_saved",
    "describe",
    "describe_saved",
    "example",
    "example_names",
    "line_of",
    "load_config",
    "load_obstacles",
    "load_saved",
    "reference",
]
