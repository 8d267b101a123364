"""Configuration: YAML to frozen dataclasses, with every mistake named by file, line and key."""

from companion.config.description import describe
from companion.config.examples import example, example_names
from companion.config.loader import load_config
from companion.config.obstacle_files import load_obstacles
from companion.config.reference import reference
from companion.config.saved_settings import SavedSettings, describe_saved, load_saved, tuned
from companion.config.schema import Config, RecordingParams, WebParams

__all__ = [
    "Config",
    "RecordingParams",
    "SavedSettings",
    "WebParams",
    "describe",
    "describe_saved",
    "example",
    "example_names",
    "load_config",
    "load_obstacles",
    "load_saved",
    "reference",
    "tuned",
]
