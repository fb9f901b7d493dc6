"""Values computed from an object, kept as long as the object lives."""

from __future__ import annotations

import weakref
from typing import Generic, TypeVar

T = TypeVar("T")


class Kept(Generic[T]):
    """Values by the identity of the object from which they were computed, beside the object and no part of it.

    A value may not refer to its object, which would then never be freed.

    Parameters
    ----------
    most : largest number of values, of which the newest remain; None for no limit.

    Examples
    --------
    >>> class Record: ...
    >>> kept, record = Kept[int](), Record()
    >>> kept.keep(record, 3)
    3
    >>> kept.of(record), len(kept)
    (3, 1)
    >>> del record
    >>> len(kept)
    0
    """

    def __init__(self, most: int | None = None) -> None:
        self._most = most
        self._values: dict[int, T] = {}

    def __len__(self) -> int:
        return len(self._values)

    def of(self, owner: object) -> T | None:
        """The value of an object; None where none is kept."""
        return self._values.get(id(owner))

    def keep(self, owner: object, value: T) -> T:
        """Keep a value in place of any other, and return it.

        Raises
        ------
        TypeError
            If the object cannot have weak references.
        """
        number = id(owner)
        if number not in self._values:
            weakref.finalize(owner, self._values.pop, number, None)
        self._values[number] = value
        if self._most is not None and len(self._values) > self._most:
            self._values.pop(next(iter(self._values)), None)
        return value


__all__ = ["Kept"]
