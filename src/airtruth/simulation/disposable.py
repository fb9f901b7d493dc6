"""Work of JSBSim in a disposable process: a model that ends, blocks or fills its process is one error of the caller.

JSBSim has no guard against a model that recurses, loops or reserves memory, and a model may do so in one state alone, so a
model that loads can still end a trim. Every command calls JSBSim through `isolated`, or in the processes that fly
campaigns (`airtruth.simulation.campaign.worker`).
"""

from __future__ import annotations

import base64
import contextlib
import os
import pickle
from collections.abc import Callable
from typing import Final, ParamSpec, TypeVar

import numpy as np

from airtruth.errors import AircraftError, StoreError, reason
from airtruth.isolation.client import call
from airtruth.isolation.limits import ProcessLimits
from airtruth.isolation.protocol import IsolatedError, Reply, Task

P = ParamSpec("P")
T = TypeVar("T")

SECONDS: Final = 300.0
"""Time for a trim or for tables of the forces [s] (judgement: 100 times that of the slowest shipped aircraft)."""
COMPUTING_S: Final = 60.0
"""Computing time of the same [s] (judgement: 20 times that of the slowest)."""
MEMORY_BYTES: Final = 4_000_000_000
"""Address space of the process [byte] (judgement: four times what the libraries reserve)."""
_STEP_S: Final = 0.01
"""Further time for a step of a simulation [s] (judgement: a replay repeats it six times, and the slowest shipped aircraft
needs 0.05 ms)."""
_STEP_BYTES: Final = 25_000
"""Further address space for a step of a simulation [byte] (judgement: a chunk of 25 runs has 20 numbers for each, six
times)."""
_MODULES: Final = ("airtruth.simulation.disposable", "numpy.ma")
"""Modules that the server imports once; numpy would import the second one in each process, at its first `np.unique`."""
_kept: Final[list[BaseException]] = []
"""Exceptions of failed executives, kept because the destructor of such an executive aborts the process."""


def limits_of(steps: int) -> ProcessLimits:
    """Limits of a trim and of flights of a number of simulation steps in all."""
    more = _STEP_S * steps
    return ProcessLimits(SECONDS + more, MEMORY_BYTES + _STEP_BYTES * steps, COMPUTING_S + more)


def isolated(work: str, function: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
    """`isolated_flight` without a flight: a trim, its derivatives or tables of the forces."""
    return isolated_flight(0, work, function, *arguments, **named)


def isolated_flight(
    steps: int, work: str, function: Callable[P, T], *arguments: P.args, **named: P.kwargs
) -> T:
    """Call a function that uses JSBSim in a disposable process; its result has the same bits as here.

    Parameters
    ----------
    steps : simulation steps of all flights, from which time and memory are allowed.
    work : what the function does for which aircraft, the subject of an error.
    function : of a module; its arguments and its result can be pickled.
    arguments, named : its arguments.

    Raises
    ------
    AircraftError
        If the process dies, does not end or needs too much memory, or JSBSim raises an exception.
    StoreError
        If the process cannot be started.
    AirtruthError
        That of the function.
    """
    folder = ""
    with contextlib.suppress(OSError):  # a folder that was deleted: only absolute paths are used then
        folder = os.getcwd()
    content = base64.b64encode(pickle.dumps((function, arguments, named))).decode()
    limits = limits_of(steps)
    task = Task(
        "airtruth.simulation.disposable:perform",
        {"work": work, "content": content, "folder": folder},
        limits,
        (*_MODULES, function.__module__),
    )
    try:
        (answer,) = call(task).arrays
    except IsolatedError as error:
        if error.kind == "start":
            raise StoreError(
                f"{work}: a process for JSBSim does not start ({error.detail}); raise the limits of memory and processes "
                "(ulimit -v, -u)"
            ) from None
        memory = f"needs more than {limits.memory_bytes / 1e9:.2g} GB of memory"
        how = {
            "time": f"gives {error.detail}",
            "memory": memory,
        }.get(error.kind, f"ends the process of JSBSim ({error.detail})")
        if error.detail == "SIGABRT":
            how += f", or {memory}"
        raise AircraftError(f"{work} {how}; correct the JSBSim model, or choose another aircraft") from None
    result: T = pickle.loads(answer.tobytes())
    return result


def perform(work: str, content: str, folder: str) -> Reply:
    """Call a pickled function in the process made for it.

    Parameters
    ----------
    work : subject of an error; content : pickled function and arguments in base64; folder : of relative paths.

    Raises
    ------
    AircraftError
        If JSBSim raises an exception.
    """
    from airtruth.simulation.simulator import STOPS

    if folder:
        os.chdir(folder)
    function, arguments, named = pickle.loads(base64.b64decode(content))
    try:
        result = function(*arguments, **named)
    except STOPS as error:
        _kept.append(error)
        raise AircraftError(f"{work} stops JSBSim with: {reason(error)}") from None
    return Reply({}, (np.frombuffer(pickle.dumps(result), dtype=np.uint8),))


__all__ = ["isolated", "isolated_flight", "limits_of"]
