"""Replaces Cython's module `cython` where it is not installed: declarations that do nothing.

Only what `companion.compiled` and `sim.compiled` use is here.
"""

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

compiled = False
# Types are used in annotations only, which plain Python does not evaluate.
Py_ssize_t = bint = const = double = pointer = sizeof = uchar = void = object()


def declare(_type: Any = None, value: Any = None, **_: Any) -> Any:
    """The value; where compiled, it has a C type."""
    return value


def cast(_type: Any, value: Any) -> Any:
    """The value."""
    return value


def exceptval(*_: Any, **__: Any) -> Callable[[T], T]:
    """A decorator without effect; where compiled, it sets how a C function reports exceptions."""
    return cfunc


def cfunc(kind: T) -> T:
    """The function or class itself."""
    return kind


cclass = final = inline = cfunc
