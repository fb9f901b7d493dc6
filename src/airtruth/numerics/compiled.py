"""How kernels are compiled.

A kernel that Python calls is an `njit` with a cache. What only kernels call is `inner`, and what both call is `shared`. The
entry from Python costs numba more than a small function itself, and numba optimises what a kernel calls again with it, so
kernels are few and flat. Assignments of arrays to slices, `np.dot` and expressions of arrays compile a library each;
loops of scalars do not.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, Final, TypeVar

from numba import njit
from numba.core.caching import IndexDataCacheFile
from numba.extending import overload, register_jitable

F = TypeVar("F", bound=Callable[..., object])

_WITHOUT_ENTRY: Final[dict[str, Any]] = {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "forceinline": True,
}
"""numba's options for a function without its entries from Python and C, inlined where it is called: a call copies each
array of the tuples that it passes, which takes three quarters of the time of the filter."""
_UNCOUNTED: Final[dict[str, Any]] = {"_nrt": False, **_WITHOUT_ENTRY}
"""The same for a function that counts no references to arrays."""
_BY_TYPES: Final[Any] = {"error_model": "numpy", **_UNCOUNTED}
"""The same as one argument."""
shared: Final = register_jitable(error_model="numpy")
"""Decorator of a small function that kernels and Python call: from Python it is the plain function."""


def inner(function: F, fastmath: Collection[str] = ()) -> F:
    """Compile a function that only kernels call, without its entry from Python: a call from Python ends the process.

    It counts no references to arrays: counting takes three quarters of the time of a small function that is given tuples of
    arrays. It can therefore allocate no array, and numba refuses to compile one that does.

    Parameters
    ----------
    fastmath : LLVM's flags.
    """
    compiled: F = njit(error_model="numpy", fastmath=set(fastmath), **_UNCOUNTED)(function)
    return compiled


def by_types(choose: Callable[..., Callable[..., object]]) -> Callable[[F], F]:
    """Decorate a function that only kernels call and whose body depends on the types of its arguments.

    Parameters
    ----------
    choose : numba's types of the arguments -> what is compiled for them, a function that calls an `inner` one.
    """

    choose.__annotations__.clear()  # numba compares the signature with that of what it returns

    def decorate(function: F) -> F:
        overload(function, jit_options=_BY_TYPES)(choose)
        return function

    return decorate


def allocating(function: F) -> F:
    """Compile a function as `inner` does, but one that allocates arrays."""
    compiled: F = njit(error_model="numpy", **_WITHOUT_ENTRY)(function)
    return compiled


def _tolerant(load: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Take an index of the cache that names a type which no longer exists for that of another version: numba compiles again."""

    def load_or_nothing(index: Any) -> Any:
        try:
            return load(index)
        except (
            AttributeError,
            ImportError,
        ):  # numba unpickles the types before it compares the versions of the source
            return {}

    return load_or_nothing


IndexDataCacheFile._load_index = _tolerant(IndexDataCacheFile._load_index)  # type: ignore[method-assign]

__all__ = ["allocating", "by_types", "inner", "shared"]
