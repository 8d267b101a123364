"""Parameters with some values changed by name, as a plan lists them."""

from collections.abc import Iterable
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from companion.errors import ConfigError

# Names and values; a hashable form, as plans are compared and sent to workers.
Changes = tuple[tuple[str, float], ...]

_Params = TypeVar("_Params")


def changed(params: _Params, changes: Iterable[tuple[str, float]]) -> _Params:
    """The parameters with some values changed; a dot leads into a part: `weights.course`.

    `ConfigError` for an unknown name, or for values that do not fit together.
    """
    for name, value in changes:
        try:
            params = _with(params, name.split("."), value)
        except (KeyError, ValueError) as error:
            kind = type(params).__name__
            why = f"there is no {name}" if isinstance(error, KeyError) else error
            raise ConfigError(f"{kind}, {name} = {value:g}: {why}") from None
    return params


def _with(params: Any, path: list[str], value: float) -> Any:
    name, *deeper = path
    if not is_dataclass(params) or name not in {one.name for one in fields(params)}:
        raise KeyError(name)
    if deeper:
        return replace(params, **{name: _with(getattr(params, name), deeper, value)})  # type: ignore[type-var]
    return replace(params, **{name: value})  # type: ignore[type-var]
