"""Installs the package as a user does: a wheel of the sources, in an environment outside the repository."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import Distribution, PathDistribution
from pathlib import Path

from packaging.requirements import Requirement

from tests.support.paths import ROOT

SOURCES = ("pyproject.toml", "setup.py", "README.md", "LICENSE", "companion", "sim", "configs")


@dataclass(frozen=True)
class Installation:
    """An environment that has the package and what its base installation depends on, and nothing else."""

    venv: Path
    folder: Path  # where commands run

    def run(self, script: str, *words: str, extras: bool = False) -> "subprocess.CompletedProcess[str]":
        """Run a command to its end; with `extras`, what the running environment has can be imported too."""
        return subprocess.run(
            self._command(script, *words), cwd=self.folder, env=self._environment(extras=extras),
            capture_output=True, text=True, timeout=240, check=False,
        )  # fmt: skip

    def start(self, script: str, *words: str, **environment: str) -> "subprocess.Popen[str]":
        """Start a command that goes on until it is stopped."""
        return subprocess.Popen(
            self._command(script, *words), cwd=self.folder, env=self._environment(extras=False) | environment,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip

    def _command(self, script: str, *words: str) -> list[str]:
        return [str(self.venv / "bin" / script), *words]

    def _environment(self, *, extras: bool) -> dict[str, str]:
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        site = importlib.metadata.distribution("matplotlib").locate_file("")
        return kept | ({"PYTHONPATH": str(site)} if extras else {})


def install(folder: Path) -> Installation:
    """Build the wheel and install it with its dependencies, which are taken from the running environment."""
    wheel = build_plain_wheel(folder)
    venv, empty = folder / "venv", folder / "empty"
    empty.mkdir()
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", venv], check=True)
    pip(folder, "--python", str(venv), "install", "--no-deps", "--no-index", str(wheel))
    (metadata,) = venv.glob("lib/python*/site-packages/mavlink_companion-*.dist-info")
    for distribution in base_of(PathDistribution(metadata)):
        link(distribution, metadata.parent)
    return Installation(venv, empty)


def build_plain_wheel(folder: Path) -> Path:
    """A wheel without extensions, as where there is no compiler: compiling takes longer than all the rest."""
    source = folder / "source"
    source.mkdir()
    for name in SOURCES:  # copied, so that nothing is written into the repository
        if (ROOT / name).is_dir():
            unwanted = shutil.ignore_patterns("__pycache__", "*.so")
            shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=unwanted)
        else:
            shutil.copy2(ROOT / name, source)
    for made in (path for name in ("companion", "sim") for path in (ROOT / "build" / name).rglob("*.c")):
        (source / made.parent.relative_to(ROOT)).mkdir(parents=True, exist_ok=True)
        shutil.copy2(made, source / made.relative_to(ROOT))  # made by Cython: not made again
    words = ("--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", "wheels")
    pip(folder, "wheel", *words, str(source), CC="no-compiler-for-this-test")
    (wheel,) = (folder / "wheels").glob("mavlink_companion-*.whl")
    return wheel


def add_extensions(installed: Installation) -> bool:
    """Put the extensions of the repository into the installation; whether there are any."""
    (site,) = installed.venv.glob("lib/python*/site-packages")
    made = [path for name in ("companion", "sim") for path in (ROOT / name / "compiled").glob("*.so")]
    for extension in made:
        shutil.copy2(extension, site / extension.relative_to(ROOT))
    return bool(made)


def pip(folder: Path, *words: str, **environment: str) -> None:
    """Run pip in a folder; it must succeed."""
    done = subprocess.run(
        [sys.executable, "-m", "pip", "--disable-pip-version-check", *words],
        cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def base_of(installed: Distribution, seen: set[str] | None = None) -> Iterator[Distribution]:
    """What a distribution requires without any extra, and what that requires."""
    seen = set() if seen is None else seen
    for requirement in map(Requirement, installed.requires or ()):
        applies = requirement.marker is None or requirement.marker.evaluate({"extra": ""})
        if not applies or requirement.name in seen:
            continue
        seen.add(requirement.name)
        found = importlib.metadata.distribution(requirement.name)
        yield found
        yield from base_of(found, seen)


def link(distribution: Distribution, site: Path) -> None:
    """Make a distribution importable from another environment."""
    for name in {Path(str(file)).parts[0] for file in distribution.files or ()} - {"..", "__pycache__"}:
        if not (site / name).exists():
            (site / name).symlink_to(str(distribution.locate_file(name)))
