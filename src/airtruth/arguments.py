"""Arguments of functions that a caller in Python may get wrong: names, whole numbers, paths and types."""

from __future__ import annotations

import os
from collections.abc import Iterable
from numbers import Integral
from pathlib import Path

from airtruth.errors import ConfigurationError


def names(argument: str, value: Iterable[str], example: str) -> tuple[str, ...]:
    """Return names that are given one by one or in a sequence; a string is one name.

    Parameters
    ----------
    argument : name of the argument, for the message.
    value : the names.
    example : a name that the message shows.

    Raises
    ------
    ConfigurationError
        If it is neither a name nor a sequence of names.

    Examples
    --------
    >>> names("methods", "ls", "ls"), names("methods", ["ls", "iv-f1"], "ls")
    (('ls',), ('ls', 'iv-f1'))
    """
    given = (value,) if isinstance(value, str) else tuple(value) if isinstance(value, Iterable) else (value,)
    if not all(isinstance(name, str) for name in given):
        raise ConfigurationError(
            f"{argument} = {value!r}: must be a name or a sequence of names, such as ({example!r},)"
        )
    return given


def require_whole(argument: str, value: object, least: int) -> None:
    """Refuse what is no whole number, or below the least.

    Raises
    ------
    ConfigurationError
        Naming the argument, its value and the least.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < least:
        raise ConfigurationError(f"{argument} = {value!r}: must be a whole number, {least} or more")


def as_path(argument: str, value: object) -> Path:
    """Return a path that is given as a string or a path.

    Raises
    ------
    ConfigurationError
        Naming the argument and its value.

    Examples
    --------
    >>> as_path("out", "out/light").name
    'light'
    """
    if not isinstance(value, str | os.PathLike):
        raise ConfigurationError(f"{argument} = {value!r}: must be the path of a file or folder")
    return Path(value)


def require_type(argument: str, value: object, kind: type, public: str) -> None:
    """Refuse what is neither None nor of a type; ``public`` is the public name of the type.

    Raises
    ------
    ConfigurationError
        Naming the argument, the type of its value and the type that it needs.
    """
    if value is not None and not isinstance(value, kind):
        raise ConfigurationError(
            f"{argument}: {type(value).__name__} is not {public}; give {public}(...) or None"
        )


__all__ = ["as_path", "names", "require_type", "require_whole"]
