"""The commands as processes that run to their end, forked from one that has imported everything."""

import os
import tempfile
from pathlib import Path
from subprocess import CompletedProcess

from tests.support.forked import CONTEXT, run_command

_PATIENCE_S = 240.0


def call(
    *arguments: str, module: str = "companion", folder: Path | None = None, **environment: str
) -> "CompletedProcess[str]":
    """Run `companion`, or with the module `sim` `companion-sim`, to its end in `folder`."""
    with tempfile.TemporaryDirectory() as place:
        written = Path(place, "stdout"), Path(place, "stderr")
        process = CONTEXT.Process(target=_run, args=(module, arguments, folder, environment, written))
        process.start()
        process.join(_PATIENCE_S)
        if process.exitcode is None:
            process.kill()
            raise TimeoutError(f"{module} {' '.join(arguments)}")
        out, errors = (path.read_text() for path in written)
        return CompletedProcess([module, *arguments], process.exitcode, out, errors)


def _run(
    module: str,
    arguments: tuple[str, ...],
    folder: Path | None,
    environment: dict[str, str],
    written: tuple[Path, Path],
) -> None:
    for number, path in enumerate(written, 1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT), number)
    run_command(module, arguments, folder, environment)
