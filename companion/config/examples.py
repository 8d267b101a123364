"""Example files that come with the package: configurations to start from, and the systemd unit."""

from pathlib import Path

from companion.errors import ConfigError

# A link to the repository's `configs`; the same files, copied, in an installed package.
_FOLDER = Path(__file__).parents[1] / "examples"


def example_names() -> list[str]:
    """The names for `example`: configurations without `.yaml`, other files with their suffix."""
    return sorted(_files())


def example(name: str) -> str:
    """The text of an example; `ConfigError` if there is none of that name."""
    try:
        return _files()[name].read_text(encoding="utf-8")
    except KeyError:
        raise ConfigError(f"--example {name}: there are {', '.join(example_names())}") from None


def _files() -> dict[str, Path]:
    files = {path.stem: path for path in _FOLDER.glob("*.yaml") if path.stem != "reference"}
    return files | {path.name: path for path in _FOLDER.glob("*.service")}
