"""The process behind `airtruth.isolation.client`: it imports the readers once and forks for each task.

It never touches a file of a task itself, so no file can damage it for the next one. It ends when its caller does.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import signal
import socket
import struct
import sys
from collections.abc import Iterable
from typing import Final

from airtruth.isolation.limits import impose
from airtruth.isolation.protocol import Task, perform

STATUS: Final = struct.Struct("<i")
"""Wait status of the process of a task, as the system reports it."""
SIZE: Final = struct.Struct("<I")
"""Length of a task [byte]."""


def serve(channel: socket.socket) -> None:
    """Perform tasks until the caller closes the channel.

    A task arrives as its length, with the descriptor of a pipe for the reply, and its JSON. The wait status of its
    process is the acknowledgement.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        head, descriptors, _, _ = socket.recv_fds(channel, SIZE.size, 1)
        if len(head) < SIZE.size or not descriptors:
            return
        text = received(channel, SIZE.unpack(head)[0])
        task = Task.decoded(text)
        for module in task.modules:
            with contextlib.suppress(ImportError):  # an optional package; the function says so
                importlib.import_module(module)
        process = os.fork()
        if process == 0:
            channel.close()
            _run(task, descriptors[0])
        os.close(descriptors[0])
        channel.sendall(STATUS.pack(os.waitpid(process, 0)[1]))


def received(channel: socket.socket, size: int) -> bytes:
    """Return exactly ``size`` bytes; fewer only where the other end has closed."""
    parts = bytearray()
    while len(parts) < size and (part := channel.recv(size - len(parts))):
        parts += part
    return bytes(parts)


def _run(task: Task, descriptor: int) -> None:
    """Perform a task in the process made for it, which ends here."""
    code = 1
    try:
        impose(task.limits)
        _write(descriptor, perform(task))
        code = 0
    finally:
        os._exit(code)


def _write(descriptor: int, parts: Iterable[bytes | memoryview]) -> None:
    with open(descriptor, "wb", buffering=0) as pipe:
        for part in parts:
            view = memoryview(part).cast("B")
            while len(view):
                view = view[pipe.write(view) :]


def once() -> None:
    """Perform the task on stdin and reply on stdout: for systems without fork."""
    task = Task.decoded(sys.stdin.buffer.read())
    impose(task.limits)
    descriptor = os.dup(1)
    os.dup2(2, 1)  # a reader that prints must not disturb the reply
    _write(descriptor, perform(task))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        serve(socket.socket(fileno=int(sys.argv[1])))
    else:
        once()
