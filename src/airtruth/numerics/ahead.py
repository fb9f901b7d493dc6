"""Kernels that a child process compiles into numba's cache while the command imports and compiles others.

The first command after an installation compiles its kernels. Where a second processor is free, a child compiles the
kernels that a command needs last. The command waits for one of these at its first call, and numba then reads it from the
cache. A child that fails costs time alone: the command compiles what the cache lacks. This module imports no numba, so
that the child starts before the command's own imports.
"""

from __future__ import annotations

import faulthandler
import functools
import glob
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Final, NamedTuple, ParamSpec, TypeVar

from airtruth.isolation.interpreter import environment, module_command

P = ParamSpec("P")
R = TypeVar("R")

HOME: Final = Path(__file__).absolute().parents[2]
"""Folder of the package as the command names it: numba's folder of a kernel depends on links in that name."""
PATIENCE_S: Final = 240
"""Time after which the child ends itself [s] (judgement: ten times that of its kernels on one processor)."""


class Ahead(NamedTuple):
    """Work of a child that compiles.

    Attributes
    ----------
    module : with ``KERNELS``, pairs of a kernel's full name and a call that compiles it, in the order of need.
    last : full name of the kernel that is compiled last.
    versions : number of types that it is compiled for.
    """

    module: str
    last: str
    versions: int = 1


class _Child:
    """A running child; each line that it writes is the name of a kernel that the cache holds."""

    def __init__(self, module: str) -> None:
        self._process = subprocess.Popen(
            module_command(__name__, module),
            stdin=subprocess.PIPE,  # its end tells the child that the command has ended
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=HOME,
            env=_environment(),
        )
        self._lock = threading.Lock()
        self._made: set[str] = set()
        self._lines = iter(self._process.stdout or ())

    def wait(self, kernel: str) -> None:
        """Wait until the child has compiled a kernel, or has ended."""
        with self._lock:
            while kernel not in self._made and (line := next(self._lines, None)) is not None:
                self._made.add(line.decode().strip())

    def close(self) -> None:
        """End the child."""
        self._process.kill()
        self._process.communicate()


_running: list[_Child] = []
"""The child of this process, if it has one."""


def awaited(kernel: Callable[P, R]) -> Callable[P, R]:
    """Decorate a kernel that a child may compile, and that no kernel calls: its call waits for the child."""
    name = f"{kernel.__module__}.{kernel.__name__}"

    @functools.wraps(kernel)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        for child in _running:
            child.wait(name)
        return kernel(*args, **kwargs)

    return call


@contextmanager
def compiling(ahead: Ahead) -> Iterator[None]:
    """Let a child compile kernels, if a second processor is there and the cache lacks them.

    Parameters
    ----------
    ahead : what it compiles.
    """
    if _running or _processors() < 2 or not lacking(ahead.last, ahead.versions):
        yield
        return
    try:
        _running.append(_Child(ahead.module))
    except OSError:  # no more processes: the command compiles
        yield
        return
    try:
        yield
    finally:
        _running.pop().close()


def lacking(kernel: str, versions: int = 1) -> bool:
    """Whether numba's cache has no index of a kernel that is as new as its source, or not all of its versions.

    It is not where numba keeps kernels elsewhere, or compiles none: a package in a folder that is read-only.

    Parameters
    ----------
    kernel : full name; versions : number of types that it is compiled for.
    """
    module, _, name = kernel.rpartition(".")
    source = HOME.joinpath(*module.split(".")).with_suffix(".py")
    index = f"{source.stem}.{name}-*.py{sys.version_info.major}{sys.version_info.minor}*.nbi"
    stated = os.environ.get("NUMBA_CACHE_DIR")
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0" or not (stated or os.access(source.parent, os.W_OK)):
        return False
    kept = Path(stated).glob(f"*/{index}") if stated else source.parent.glob(f"__pycache__/{index}")
    try:
        made = source.stat().st_mtime
        return not any(
            path.stat().st_mtime >= made
            and len(list(path.parent.glob(f"{glob.escape(path.stem)}.*.nbc"))) >= versions
            for path in kept
        )
    except OSError:  # another process replaces the files
        return False


def _environment() -> dict[str, str]:
    """Environment of the child: the names of the package and of the cache are those of the command."""
    made = environment()
    made["PYTHONPATH"] = os.pathsep.join([str(HOME), made["PYTHONPATH"]])
    if made.get("NUMBA_CACHE_DIR"):
        made["NUMBA_CACHE_DIR"] = os.path.abspath(made["NUMBA_CACHE_DIR"])
    return made


def _processors() -> int:
    """Processors that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _end_with_the_caller() -> None:
    os.read(0, 1)  # a reader of sys.stdin would hold its lock at the end of the interpreter
    os._exit(0)


def main() -> None:
    """Compile the kernels of a module, and print the name of each."""
    faulthandler.dump_traceback_later(PATIENCE_S, exit=True)
    threading.Thread(target=_end_with_the_caller, daemon=True).start()
    parts = sys.argv[1].split(".")
    for count in range(2, len(parts)):
        # what the packages themselves import is larger than what kernels need
        package = ModuleType(".".join(parts[:count]))
        package.__path__ = [str(HOME.joinpath(*parts[:count]))]
        sys.modules[package.__name__] = package
    for name, compile_it in import_module(sys.argv[1]).KERNELS:
        compile_it()
        print(name, flush=True)


if __name__ == "__main__":
    main()

__all__ = ["Ahead", "awaited", "compiling", "lacking"]
