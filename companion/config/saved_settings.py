"""The settings that the operator changed in flight, from the file in which they outlast a restart.

It goes before the configuration, and never stops a start: what of it cannot be used is said, and left out.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from companion.config.document import shown
from companion.config.keys import file_key
from companion.config.schema import Config
from companion.gcs.parameters import BY_NAME, values_changed, with_values

_MOST_BYTES = 1 << 16


@dataclass(frozen=True, slots=True)
class SavedSettings:
    """Values by name that differ from the configuration; `problem` is one line on what could not be used."""

    values: Mapping[str, float] = field(default_factory=dict)
    problem: str | None = None


def load_saved(config: Config, path: Path | None = None) -> SavedSettings:
    """What was saved in a file (default: the configuration's), as far as it goes with the configuration."""
    path = path or config.settings_file
    try:
        with path.open("rb") as file:
            raw = file.read(_MOST_BYTES + 1)
        values = json.loads(raw.decode("ascii")) if len(raw) <= _MOST_BYTES else None
    except FileNotFoundError:
        return SavedSettings()
    except OSError as error:
        return SavedSettings(problem=f"{path}: cannot be read, not used: {error.strerror}")
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        return SavedSettings(problem=f"{path}: damaged, not used")
    configured = config.for_engine()
    tuned, refused = with_values(configured, values)
    problem = f"{path}: not used: {shown('; '.join(refused), 200)}" if refused else None
    return SavedSettings(values_changed(tuned, configured), problem)


def tuned(config: Config, saved: SavedSettings) -> Config:
    """The configuration as it counts with what was saved."""
    engine, _ = with_values(config.for_engine(), saved.values)
    return replace(config, engine=engine.engine, supervisor=engine.supervisor, avoidance=engine.avoidance)


def describe_saved(config: Config, saved: SavedSettings) -> Iterator[str]:
    """What counts instead of the configuration, a line for each."""
    configured = config.for_engine()
    for name, value in saved.values.items():
        tunable = BY_NAME[name]
        before = tunable.shown(tunable.value(configured))
        yield f"{name} {tunable.shown(value)} instead of {before}: {file_key(tunable.field)}"
