"""Values computed from an object, kept as long as the object lives."""

from __future__ import annotations

import weakref
from typing import Generic, TypeVar

T = TypeVar("T")


class Kept(Generic[T]):
    """Values by the identity of the object from which they were computed, beside the object and no part of it.

    A value may not refer to its object, which would then never be freed.

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

    def __init__(self) -> None:
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
        return value


__all__ = ["Kept"]
