"""Call a function in a disposable process.

One server (`airtruth.isolation.server`) is started at the first call and forks for each further one, so that a call
costs some milliseconds. Without fork each call starts an interpreter.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import select
import signal
import socket
import subprocess
import threading
import time
from typing import Final

from airtruth.isolation.interpreter import HOME, environment, module_command
from airtruth.isolation.protocol import IsolatedError, Reply, Task, understood
from airtruth.isolation.server import SIZE, STATUS, received

PATIENCE_S: Final = 60.0
"""Time beyond that of the task before the caller gives up [s] (judgement: a slow disk loads the libraries in less)."""
_MODULE: Final = "airtruth.isolation.server"
"""Module of the server."""
_PLAIN: Final = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "MALLOC_ARENA_MAX": "1",
    "ARROW_IO_THREADS": "1",
    "ARROW_DEFAULT_MEMORY_POOL": "system",
}
"""Environment of the server: no threads, which a fork would lose and which reserve address space."""


def call(task: Task) -> Reply:
    """Perform a task in a process of its own and return its reply.

    Raises
    ------
    AirtruthError
        That of the function.
    IsolatedError
        If the process died, took too long, needed too much memory, or did not start.
    UnforeseenError
        If the function raised anything else.
    """
    return understood(
        _forked(task) if hasattr(os, "fork") and hasattr(socket, "send_fds") else _started(task)
    )


class _Server:
    """A running server and the socket to it."""

    def __init__(self) -> None:
        self.owner = os.getpid()
        self.channel, other = socket.socketpair()
        with other:
            self.process = subprocess.Popen(
                module_command(_MODULE, str(other.fileno())),
                pass_fds=[other.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                cwd=HOME,
                env=environment(**_PLAIN),
                start_new_session=True,
            )

    def answer(self, task: Task) -> tuple[bytes, int]:
        """Bytes of the reply and wait status of the process that made it."""
        reading, writing = os.pipe()
        with open(reading, "rb", buffering=0) as pipe:
            try:
                text = task.encoded()
                socket.send_fds(self.channel, [SIZE.pack(len(text))], [writing])
                self.channel.sendall(text)
            finally:
                os.close(writing)
            deadline = time.monotonic() + task.limits.seconds + PATIENCE_S
            parts = bytearray()
            while True:
                ready, _, _ = select.select([pipe], [], [], max(0.0, deadline - time.monotonic()))
                if not ready:
                    raise IsolatedError("time", f"no answer within {task.limits.seconds:.0f} s")
                part = pipe.read(1 << 20)
                if not part:
                    break
                parts += part
                if len(parts) > task.limits.memory_bytes:
                    raise IsolatedError("memory", "the answer exceeds the limit")
        status = received(self.channel, STATUS.size)
        if len(status) < STATUS.size:
            raise IsolatedError("start", f"exit code {self.process.wait()}")
        return bytes(parts), STATUS.unpack(status)[0]

    def close(self, *, kill: bool = False) -> None:
        """End the server; with ``kill`` at once, and the process of a running task with it."""
        self.channel.close()
        if os.getpid() != self.owner:
            self.process.returncode = 0  # the parent of this process waits for it
            return
        if kill:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


_lock: Final = threading.Lock()
"""Held during a call: tasks of several threads follow each other."""
_running: list[_Server] = []


def _forked(task: Task) -> bytes:
    with _lock:
        if _running and _running[0].owner != os.getpid():
            _running.pop().close()
        if not _running:
            _running.append(_Server())
        try:
            parts, status = _running[0].answer(task)
        except OSError as error:
            _running.pop().close(kill=True)
            raise IsolatedError("start", str(error)) from None
        except BaseException:  # an interrupt as well: the reply would otherwise be read by the next call
            _running.pop().close(kill=True)
            raise
    _check(os.waitstatus_to_exitcode(status), task)
    return parts


def _started(task: Task) -> bytes:
    try:
        done = subprocess.run(
            module_command(_MODULE),
            input=task.encoded(),
            capture_output=True,
            timeout=task.limits.seconds + PATIENCE_S,
            check=False,
            cwd=HOME,
            env=environment(**_PLAIN),
        )
    except subprocess.TimeoutExpired:
        raise IsolatedError("time", f"no answer within {task.limits.seconds:.0f} s") from None
    _check(done.returncode, task)
    return done.stdout


def _check(code: int, task: Task) -> None:
    """Raise unless a process ended well; its own clocks end it by SIGALRM and SIGPROF."""
    if code == 0:
        return
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"exit code {code}"
    if name == "SIGALRM":
        raise IsolatedError("time", f"no answer within {task.limits.seconds:.0f} s")
    if name == "SIGPROF":
        raise IsolatedError("time", f"no answer within {task.limits.computing_s:.0f} s of computing time")
    raise IsolatedError("crash", name)


def close() -> None:
    """End the server; the next call starts another."""
    with _lock:
        while _running:
            _running.pop().close()


atexit.register(close)

__all__ = ["call", "close"]
