"""The rule for every output of every command: which file may be written, and which may be replaced.

An input is never an output. A file is replaced only if the ledger of its folder (`airtruth.logs.ledger`) states that
the same command wrote it and its content has not changed since, or with ``force``. While a command runs, every file
that is written atomically passes this rule and enters the ledger.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from airtruth.errors import StoreError
from airtruth.logs import ledger
from airtruth.logs.atomic import guard
from airtruth.logs.digest import sha256_of
from airtruth.logs.remote import RemotePath, files_below, location
from airtruth.logs.temporary import clear


class Outputs:
    """Outputs that one command may write.

    Parameters
    ----------
    command : name of the command.
    inputs : files that it reads.
    force : replace files that the command did not write, or that changed since.
    """

    def __init__(self, command: str, inputs: Iterable[Path], force: bool) -> None:
        self.command = command
        self._inputs = {file for path in inputs if (file := _identity(location(path))) is not None}
        self._force = force
        self._cleared: set[Path] = set()

    def require(self, *paths: Path) -> None:
        """Refuse outputs that may not be written, before the command starts its work.

        Raises
        ------
        StoreError
            Naming the file, the reason and the next step.
        """
        for path in paths:
            self.before(location(path))

    def require_folder(self, folder: Path) -> None:
        """Refuse a folder that is replaced as a whole unless a command wrote all that it holds.

        Raises
        ------
        StoreError
            Naming the first file that is not as written.
        """
        clear(folder.parent)
        if self._force or not folder.is_dir() or not any(folder.iterdir()):
            return
        written = ledger.read(folder)
        for path in sorted(files_below(folder)):
            name = path.relative_to(folder).as_posix()
            if name != ledger.LEDGER and (name not in written or sha256_of(path) != written[name].sha256):
                how = "changed since airtruth wrote it" if name in written else "was not written by airtruth"
                raise StoreError(
                    f"{path}: {how}, and the whole folder would be replaced; move the file, choose another --out, or "
                    "replace the folder with --force"
                )

    def before(self, path: Path) -> None:
        """Raise `StoreError` if the file may not be written."""
        if path.parent not in self._cleared:
            clear(path.parent)
            self._cleared.add(path.parent)
        try:
            mode = _mode(path)
        except OSError:  # it does not exist, or writing it names the reason
            return
        if _identity(path) in self._inputs:
            raise StoreError(f"{path}: is an input of this command; choose another --out")
        if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode) or stat.S_ISDIR(mode)):
            raise StoreError(f"{path}: is not a regular file; choose another --out")
        if self._force or stat.S_ISDIR(mode):
            return
        entry = ledger.read(path.parent).get(path.name)
        if entry is None:
            reason = "exists and was not written by airtruth"
        elif sha256_of(path) not in (entry.sha256, entry.replaced):
            reason = "changed since airtruth wrote it"
        elif entry.command != self.command:
            reason = f"was written by another command (airtruth {entry.command})"
        else:
            return
        raise StoreError(f"{path}: {reason}; choose another --out, or replace it with --force")

    def record(self, path: Path, written: Path) -> None:
        """Record the content of ``path``, which ``written`` holds and which appears there next."""
        ledger.add(path, self.command, written, force=self._force)


@contextmanager
def writing(command: str, inputs: Iterable[Path] = (), *, force: bool = False) -> Iterator[Outputs]:
    """Apply the rule to every file that is written atomically in this block.

    Parameters
    ----------
    command, inputs, force : see `Outputs`.
    """
    outputs = Outputs(command, inputs, force)
    token = guard.set(outputs)
    try:
        yield outputs
    finally:
        guard.reset(token)


def _mode(path: Path) -> int:
    """Kind of a file; raises ``OSError`` if it does not exist."""
    if not isinstance(path, RemotePath):
        return path.lstat().st_mode
    if not path.is_file():
        raise FileNotFoundError
    return stat.S_IFREG


def _identity(path: Path) -> tuple[int, int] | str | None:
    """Device and number of a file, the same under every name; a store has one name; None if it does not exist."""
    if isinstance(path, RemotePath):
        return str(path)
    try:
        facts = os.stat(path)
    except OSError:
        return None
    return facts.st_dev, facts.st_ino


__all__ = ["Outputs", "writing"]
