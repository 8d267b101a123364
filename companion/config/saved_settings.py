"""Saved settings: those that the operator changed in flight, from the file that preserves them.

They take precedence over the configuration. Unusable settings are reported and skipped; they never stop a
start.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from companion.config.document import quoted
from companion.config.keys import file_key
from companion.config.schema import Config
from companion.files import read_small, reason
from companion.gcs.parameters import BY_NAME, values_changed, with_values


@dataclass(frozen=True, slots=True)
class SavedSettings:
    """Values by name that differ from the configuration; `problem` is one line about unusable values.

    `damaged`: the whole file is unusable.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    problem: str | None = None
    damaged: bool = False


def load_saved(config: Config, path: Path | None = None) -> SavedSettings:
    """The usable values in a settings file (default: the file named in the configuration)."""
    path = path or config.settings_file
    try:
        values = json.loads(read_small(path).decode("ascii"))
    except (FileNotFoundError, NotADirectoryError):
        return SavedSettings()
    except OSError as error:
        why = f"cannot be read, not used: {reason(error)}"
        return SavedSettings(problem=f"{path}: {why}", damaged=True)
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        return SavedSettings(problem=f"{path}: damaged, not used", damaged=True)
    configured = config.for_engine()
    changed, refused = with_values(configured, values)
    problem = f"{path}: not used: {quoted('; '.join(refused), 200)}" if refused else None
    return SavedSettings(values_changed(changed, configured), problem)


def apply_saved(config: Config, saved: SavedSettings) -> Config:
    """The configuration with the saved values in place of its own."""
    engine, _ = with_values(config.for_engine(), saved.values)
    return replace(config, engine=engine.engine, supervisor=engine.supervisor, avoidance=engine.avoidance)


def describe_saved(config: Config, saved: SavedSettings) -> Iterator[str]:
    """One line for each saved value, with the configured value that it replaces."""
    configured = config.for_engine()
    for name, value in saved.values.items():
        parameter = BY_NAME[name]
        before = parameter.shown(parameter.value(configured))
        yield f"{name} {parameter.shown(value)} instead of {before}: {file_key(parameter.field)}"
