"""Results on stdout and notices on stderr, so that a full disk or a closed pipe is reported once."""

from __future__ import annotations

import codecs
import io
import logging
import os
import sys
from pathlib import Path
from typing import Final

ESCAPE: Final = "airtruth-escape"
"""Name of the handler that writes a character which a terminal cannot show as \\uXXXX."""


def escape_what_cannot_be_encoded() -> None:
    """Make stdout and stderr write \\uXXXX for a character outside their encoding, and never raise.

    TOML and JSON read this escape, so a mapping that `import --guess` prints remains valid.
    """
    codecs.register_error(ESCAPE, _escaped)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=ESCAPE)


def _escaped(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    codes = [ord(character) for character in error.object[error.start : error.end]]
    return "".join(f"\\u{c:04X}" if c < 0x10000 else f"\\U{c:08X}" for c in codes), error.end


def print_result(text: str, end: str = "\n") -> None:
    """Write a result to stdout and flush it, so that a full disk is reported while a message is possible.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    try:
        print(text, end=end, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        from airtruth.logs.atomic import write_error

        close_stdout()
        raise write_error(Path("standard output"), error) from None


def notice(text: str) -> None:
    """Write one line to stderr, under the program's name; nothing if stderr is closed."""
    logging.getLogger("airtruth").warning(text)
    if sys.stderr is not None:
        print(f"airtruth: {text}", file=sys.stderr)


def close_stdout() -> None:
    """Redirect stdout to the null device, because the interpreter flushes its buffer again at exit."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
