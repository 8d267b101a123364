"""The commands as processes, forked from one that has imported everything, which saves a second each."""

import importlib
import multiprocessing
import os
import sys
import tempfile
from pathlib import Path
from subprocess import CompletedProcess

_PATIENCE_S = 240.0
_context = multiprocessing.get_context("forkserver")
_context.set_forkserver_preload(
    [
        "companion.cli", "companion.preflight", "companion.replay", "companion.runtime",
        "companion.report.page", "sim.cli", "sim.campaign.command", "sim.demo",
        "sim.paper.command", "matplotlib.pyplot",
    ]
)  # fmt: skip


def call(
    *arguments: str, module: str = "companion", folder: Path | None = None, **environment: str
) -> "CompletedProcess[str]":
    """Run `companion`, or with the module `sim` `companion-sim`, to its end in `folder`."""
    with tempfile.TemporaryDirectory() as place:
        written = Path(place, "stdout"), Path(place, "stderr")
        process = _context.Process(target=_run, args=(module, arguments, folder, environment, written))
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
    os.environ |= environment
    os.chdir(folder or Path.cwd())
    sys.argv = ["-c", *arguments]
    importlib.import_module(f"{module}.cli").main()
