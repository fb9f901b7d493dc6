"""Child process of `airtruth.simulation.campaign.workers`: flies chunks and reports on its first standard output.

It reads a pickled plan without its table and the folders, then one line per chunk with its runs (`encoded`), and answers
one JSON line per event.
"""

from __future__ import annotations

import base64
import json
import os
import pickle
import signal
import sys
import threading
import time
import traceback
import zlib
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Final

from airtruth.isolation.limits import impose_cpu_time, impose_memory
from airtruth.simulation.disposable import limits_of

if TYPE_CHECKING:
    from pathlib import Path

    from airtruth.simulation.campaign.chunk import ChunkOrder
    from airtruth.simulation.campaign.plan import Plan

_PARENT_CHECK_S: Final = 0.5
"""Period at which a worker checks that its parent lives [s] (judgement: an orphan ends within a second at no cost)."""


def encoded(order: ChunkOrder, crashed: Mapping[str, str]) -> bytes:
    """Line of an order: small enough that two fit into the buffer of a pipe, so that the caller never waits.

    Parameters
    ----------
    order : the chunk and its runs; crashed : runs that end their process, with the reason.
    """
    return base64.b64encode(zlib.compress(pickle.dumps((order, dict(crashed)), 5))) + b"\n"


def main() -> None:
    """Fly the chunks that the standard input names until it ends or something fails."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    threading.Thread(target=_die_with, args=(os.getppid(),), daemon=True).start()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # JSBSim prints there

    def answer(**event: object) -> None:
        answers.write(json.dumps(event) + "\n")

    from airtruth.errors import AirtruthError

    limited = False
    try:
        plan, logs, truths = pickle.load(sys.stdin.buffer)
        limited = impose_memory(limits_of(plan.samples).memory_bytes)
        _fly(plan, (logs, truths), answer)
    except AirtruthError as error:
        answer(event="error", kind=type(error).__name__, message=str(error))
    except MemoryError:
        answer(event="memory", own=limited)
    except BaseException:
        answer(event="unforeseen", message=traceback.format_exc())


def _fly(plan: Plan, folders: tuple[Path, Path], answer: Callable[..., None]) -> None:
    from airtruth.simulation.campaign.chunk import Pilot

    pilot = Pilot(plan)
    allowed_s = limits_of(plan.samples).seconds

    def starts(run_id: str) -> None:
        answer(event="starts", run_id=run_id)
        impose_cpu_time(allowed_s)

    for line in sys.stdin.buffer:
        order, crashed = pickle.loads(zlib.decompress(base64.b64decode(line)))
        chunk = pilot.fly_chunk(
            order,
            *folders,
            crashed,
            starts,
        )
        impose_cpu_time(0.0)
        answer(event="ended", **asdict(chunk))


def _die_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_PARENT_CHECK_S)
    os._exit(1)


if __name__ == "__main__":
    main()
