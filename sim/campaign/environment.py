"""The software versions that results depend on; all workers of a campaign must have the same."""

import os
import platform
from collections.abc import Iterator, Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import companion
import sim

# Versions by name, as shown to the user.
Environment = dict[str, str]

# Packages that take part in a flight; versions of others cannot change a result.
_PACKAGES = ("numpy", "pymavlink")
# Additional packages of an avoider.
_PACKAGES_OF = {"orca": ("pyrvo",)}


def environment(avoiders: Sequence[str]) -> Environment:
    """The installed versions that these avoiders' results depend on."""
    packages = (*_PACKAGES, *(name for avoider in avoiders for name in _PACKAGES_OF.get(avoider, ())))
    return {
        "companion": f"{companion.__version__} ({_digest()})",
        "Python": ".".join(platform.python_version_tuple()[:2]),
        **{name: _version(name) for name in packages},
    }


def machine() -> dict[str, object]:
    """This machine in words: system, processor, and cores that may be used."""
    return {
        "system": f"{platform.system()} {platform.release()}",
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
    }


def difference(here: Environment, there: Environment) -> str | None:
    """The first difference in words; `None` if there is none."""
    for name, wanted in here.items():
        if (found := there.get(name, "none")) != wanted:
            return f"{name} {found}, here {wanted}"
    return None


def _processor() -> str:
    """The name of the processor; its architecture where the system has no such name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]} ({platform.machine()})" if names else platform.machine()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


@cache
def _digest() -> str:
    """A digest of the source text, since changes of the code do not change the version number."""
    whole = sha256()
    for name, path in sorted(_sources()):
        whole.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return whole.hexdigest()[:10]


def _sources() -> Iterator[tuple[str, Path]]:
    for package in (companion, sim):
        root = Path(package.__path__[0])
        for path in root.rglob("*.py"):
            yield f"{root.name}/{path.relative_to(root).as_posix()}", path
