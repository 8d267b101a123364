"""Runs the compiled modules as plain Python: import it, or `pytest -p` it, before anything that uses them."""

import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

MODULES = ("companion.compiled.kernels", "sim.compiled.airframe_step")


def load_plain(name: str) -> None:
    """Put the Python source in the place of the extension."""
    package, _, module_name = name.rpartition(".")
    parent = import_module(package)
    spec = spec_from_file_location(name, Path(parent.__path__[0]) / f"{module_name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    setattr(parent, module_name, module)


if not {*MODULES, "cython"}.isdisjoint(sys.modules):
    raise ImportError("too late: these modules, or what they need, are imported")
# As where neither a compiler nor Cython is installed.
sys.modules["cython"] = None
for each in MODULES:
    load_plain(each)
