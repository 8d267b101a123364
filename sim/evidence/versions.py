"""The versions that flew the results of a folder: a run that continues may be of another one."""

import json
from pathlib import Path

from companion.errors import ConfigError
from sim.campaign.environment import Environment

_FILE = "versions.json"


def note_version(folder: Path, version: Environment) -> None:
    """Add a version to those that flew in this folder."""
    versions = versions_of(folder)
    if version not in versions:
        (folder / _FILE).write_text(json.dumps([*versions, version], indent=2) + "\n", encoding="utf-8")


def versions_of(folder: Path) -> list[Environment]:
    """The versions that flew in this folder, the first one first; `ConfigError` for a damaged list."""
    path = folder / _FILE
    try:
        found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: no list of versions: {error}") from error
    if not isinstance(found, list):
        raise ConfigError(f"{path}: no list of versions")
    return found
