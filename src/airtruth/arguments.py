"""Arguments of functions that a caller in Python may get wrong: names and whole numbers."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Integral

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


__all__ = ["names", "require_whole"]
