"""Stands in for Cython's module `cython` where that is not installed: declarations that do nothing.

Only what `companion.compiled` and `sim.compiled` use is here.
"""

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

compiled = False
# Types stand in annotations only, which plain Python does not evaluate.
Py_ssize_t = bint = const = double = pointer = sizeof = uchar = void = object()


def declare(_type: Any = None, value: Any = None, **_: Any) -> Any:
    """The value of a variable that has a C type where compiled."""
    return value


def cast(_type: Any, value: Any) -> Any:
    """The value."""
    return value


def exceptval(*_: Any, **__: Any) -> Callable[[T], T]:
    """How a C function reports exceptions."""
    return cfunc


def cfunc(kind: T) -> T:
    """The function or class itself."""
    return kind


cclass = final = inline = cfunc
