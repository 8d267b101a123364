"""What the commands share: arguments, exit codes, and the progress bar."""

import contextlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from companion import __version__
from companion.compiled import slow_notice
from companion.errors import CompanionError, ConfigError
from companion.files import why_not_writable

ConfigFile = Annotated[
    Path, typer.Argument(metavar="CONFIG", help="Configuration file, YAML.", show_default=False)
]
VersionFlag = Annotated[bool, typer.Option("--version", help="Show the version and exit.")]


def show_version(program: str) -> None:
    """Print the program's name and version, and exit."""
    typer.echo(f"{program} {__version__}")
    raise typer.Exit


def run_app(app: typer.Typer) -> int:
    """Run an application and return its exit code: 0 done, 1 failed, 2 bad usage or configuration.

    A `CompanionError` is printed as one line.
    """
    try:
        app()
    except CompanionError as error:
        with contextlib.suppress(OSError):  # the terminal may be gone
            sys.stderr.write(f"{error}\n")
        return 2 if isinstance(error, ConfigError) else 1
    except SystemExit as leave:
        return leave.code if isinstance(leave.code, int) else 1
    return 0


def note_if_slow() -> None:
    """Print one line on stderr when the inner loops are not compiled."""
    if (notice := slow_notice()) is not None:
        sys.stderr.write(f"{notice}\n")


def writable(path: Path) -> Path:
    """Return the path if a file can be written there; `ConfigError` otherwise."""
    if (why := why_not_writable(path)) is not None:
        raise ConfigError(f"{path}: cannot be written: {why}")
    return path


class ProgressBar:
    """A bar over the bytes of a log and its later parts; as a context, gives the function that moves it."""

    def __init__(self, console: Console, *logs: Path) -> None:
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("kB"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        size = sum(log.stat().st_size for log in logs if log.is_file())
        self._task = self._bar.add_task(logs[0].name, total=size // 1000)

    def __enter__(self) -> Callable[[int], None]:
        self._bar.start()
        return lambda read_bytes: self._bar.update(self._task, completed=read_bytes // 1000)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
