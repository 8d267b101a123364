"""Reads and validates the simulation's YAML files; an error is one line that names file and key."""

from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError

from companion.errors import ConfigError

# For the dataclasses that files are read into.
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)

T = TypeVar("T")


def read_checked(path: Path, kind: type[T]) -> T:
    """The file's content as a validated dataclass; `ConfigError` if it is invalid."""
    return checked_from(_content(path), kind, str(path))


def has_key(path: Path, key: str) -> bool:
    """Whether the file has this key at its top; `ConfigError` if it cannot be read."""
    content = _content(path)
    return isinstance(content, dict) and key in content


def _content(path: Path) -> Any:
    """The parsed file; `ConfigError` if it cannot be read."""
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not a text file in UTF-8") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: {' '.join(str(error).split())}") from error


def checked_from(content: Any, kind: type[T], source: str) -> T:
    """A validated dataclass from parsed YAML; errors begin with `source`."""
    try:
        return TypeAdapter(kind).validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        why = "unknown key" if first["type"] == "unexpected_keyword_argument" else first["msg"]
        raise ConfigError(f"{source}: {key}: {why}" if key else f"{source}: {why}") from error


def names_in(folder: Path) -> list[str]:
    """Names of the YAML files that come with the project in a folder."""
    return sorted(path.stem for path in folder.glob("*.yaml"))


def read_named(name_or_path: str | Path, folder: Path, kind: type[T], what: str) -> T:
    """Read one of a folder's files by name, or any file by its path; `ConfigError` names file and key."""
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        path = folder / f"{name_or_path}.yaml"
        if not path.is_file():
            known = ", ".join(names_in(folder)) or "none installed"
            raise ConfigError(f"{name_or_path}: no such {what}; there are: {known}")
    return read_checked(path, kind)
