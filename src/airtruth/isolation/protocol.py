"""Messages between the caller and the disposable process: a task as JSON, a reply as JSON with arrays behind it."""

from __future__ import annotations

import importlib
import json
import struct
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from airtruth import errors
from airtruth.errors import AirtruthError
from airtruth.isolation.limits import Limits

LENGTH: Final = struct.Struct("<Q")
"""Length of the JSON before it [byte]."""

Kind = Literal["reply", "error", "memory", "unforeseen"]


@dataclass(frozen=True)
class Task:
    """A call: ``function`` is "package.module:name", its arguments and the modules to import before it are JSON."""

    function: str
    arguments: Mapping[str, Any]
    limits: Limits
    modules: tuple[str, ...] = ()

    def encoded(self) -> bytes:
        """The task as JSON."""
        return json.dumps(
            {
                "function": self.function,
                "arguments": dict(self.arguments),
                "limits": self.limits.to_dict(),
                "modules": list(self.modules),
            }
        ).encode()

    @classmethod
    def decoded(cls, text: bytes) -> Task:
        """Inverse of `encoded`."""
        raw = json.loads(text)
        return cls(raw["function"], raw["arguments"], Limits(**raw["limits"]), tuple(raw["modules"]))


@dataclass(frozen=True)
class Reply:
    """Result of a task: facts that are JSON, and arrays of numbers, dates or text of fixed length."""

    facts: Mapping[str, Any]
    arrays: tuple[NDArray[Any], ...] = field(default=())


class IsolatedError(Exception):
    """The process of a task gave no reply: ``kind`` is "crash", "time", "memory" or "start"."""

    def __init__(self, kind: Literal["crash", "time", "memory", "start"], detail: str) -> None:
        super().__init__(f"{kind}: {detail}")
        self.kind = kind
        self.detail = detail


class UnforeseenError(Exception):
    """The function of a task raised an exception that is no `AirtruthError`; the message is its traceback."""


def perform(task: Task) -> list[bytes | memoryview]:
    """Call the function of a task and return its reply, or its exception, as bytes to send."""
    try:
        module, _, name = task.function.partition(":")
        function: Callable[..., Reply] = getattr(importlib.import_module(module), name)
        reply = function(**task.arguments)
        return _frame("reply", dict(reply.facts), reply.arrays)
    except AirtruthError as error:
        return _frame("error", {"class": type(error).__name__, "message": str(error)})
    except MemoryError:
        return _frame("memory", {})
    except Exception as error:
        return _frame("unforeseen", {"traceback": "".join(traceback.format_exception(error))})


def _frame(
    kind: Kind, facts: Mapping[str, Any], arrays: tuple[NDArray[Any], ...] = ()
) -> list[bytes | memoryview]:
    solid = [np.ascontiguousarray(array) for array in arrays]
    described = [{"dtype": array.dtype.str, "shape": list(array.shape)} for array in solid]
    header = json.dumps({"kind": kind, "facts": facts, "arrays": described}).encode()
    return [LENGTH.pack(len(header)), header, *(array.view(np.uint8).data for array in solid if array.size)]


def understood(answer: bytes) -> Reply:
    """Return the reply that `perform` sent.

    Raises
    ------
    AirtruthError
        That of the function.
    IsolatedError
        If memory ran out, or the answer is incomplete.
    UnforeseenError
        If the function raised anything else.
    """
    if not answer:
        raise IsolatedError("crash", "exit code 0, incomplete answer")
    try:
        (length,) = LENGTH.unpack_from(answer)
        start = LENGTH.size + length
        header = json.loads(answer[LENGTH.size : start])
        kind, facts = header["kind"], header["facts"]
        arrays = []
        for entry in header["arrays"]:
            dtype, shape = np.dtype(entry["dtype"]), tuple(entry["shape"])
            count = int(np.prod(shape, dtype=np.int64))
            arrays.append(
                np.frombuffer(answer, dtype, count, start).reshape(shape) if count else np.empty(shape, dtype)
            )
            start += count * dtype.itemsize
    except (struct.error, ValueError, KeyError) as error:
        raise IsolatedError("crash", f"incomplete answer: {error}") from None
    if kind == "error":
        raise getattr(errors, facts["class"])(facts["message"])
    if kind == "memory":
        raise IsolatedError("memory", "out of memory")
    if kind == "unforeseen":
        raise UnforeseenError(facts["traceback"])
    return Reply(facts, tuple(arrays))


__all__ = ["IsolatedError", "Reply", "Task", "UnforeseenError", "perform", "understood"]
