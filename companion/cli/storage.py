"""The files that a flight writes: whether they can be written, found out before the flight."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from companion.config import Config, line_of
from companion.files import why_no_new_file, why_not_replaceable


class StorageProblem(NamedTuple):
    """A path of the configuration that cannot be written, by its key."""

    key: str
    path: Path
    why: str

    def in_file(self, config_file: Path) -> str:
        """One line with file, line and key."""
        line = line_of(config_file, *self.key.split("."))
        where = f"{config_file}:{line}" if line is not None else f"{config_file}"
        return f"{where}: {self.key}: {self.path} cannot be written: {self.why}"


def storage_problems(config: Config) -> Iterator[StorageProblem]:
    """What could not be written in a flight with this configuration."""
    for key, path in (("state_file", config.state_file), ("settings_file", config.settings_file)):
        if (why := why_not_replaceable(path)) is not None:
            yield StorageProblem(key, path, why)
    recording = config.recording
    if recording.enabled and (why := why_no_new_file(recording.directory)) is not None:
        yield StorageProblem("recording.directory", recording.directory, why)
