"""Folders of object stores (s3://, gs://) as paths, through pyarrow.fs.

A key appears complete or not at all, by one upload, so no rename is needed. A store has to list what was written before
(S3 and Google Cloud Storage do). Addresses and credentials come from the environment: see docs/stores.md.
"""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path, PosixPath
from typing import Any, Final, NoReturn, TypeVar
from urllib.parse import unquote, urlsplit

from airtruth.errors import StoreError, choices, reason

Item = TypeVar("Item")
Result = TypeVar("Result")

SCHEMES: Final = {"s3": "?allow_delayed_open=true", "gs": "?retry_limit_seconds=30"}
"""Scheme of a URL -> options of pyarrow: a small key is one upload (s3); a store that is silent for 30 s has failed (gs)."""
GOOGLE_EMULATOR: Final = "CLOUD_STORAGE_EMULATOR_ENDPOINT"
"""Variable with the address of an emulator of Google Cloud Storage, as Google's C++ client reads it."""
REQUESTS: Final = 16
"""Requests to a store at a time [-] (judgement: each waits for some 10 ms, and few processors are needed)."""
_DENIED: Final = (
    "ACCESS_DENIED",
    "INVALID_ACCESS_KEY_ID",
    "SIGNATURE",
    "EXPIRED_TOKEN",
    "PERMISSION_DENIED",
    "UNAUTHENTICATED",
    "HTTP status 403",
)
"""Words of a store's answer to a request without permission."""
_SILENT: Final = ("NETWORK_CONNECTION", "curlCode", "CURL error", "REQUEST_TIMEOUT", "UNAVAILABLE")
"""Words of the error of a store that does not answer."""
_ABSENT: Final = ("NO_SUCH_BUCKET", "specified bucket does not exist", "HTTP status 404")
"""Words of the error of a bucket that does not exist."""


class RemotePath(PosixPath):
    """A key of an object store, or the keys below it: the methods of a path that logs and campaigns use.

    It is made by `location`. A folder exists if a key lies below it. Writing is `upload` alone. A method raises
    `StoreError` if the store refuses or does not answer, and ``FileNotFoundError`` for a key that is not there.
    """

    def __str__(self) -> str:
        """URL of the key."""
        return super().__str__().replace(":/", "://", 1)

    def __fspath__(self) -> str:
        """URL of the key, which no local file has as its name."""
        return str(self)

    def __rtruediv__(self, other: object) -> RemotePath:
        """The key itself: it is absolute, whatever the folder before it."""
        return self

    @property
    def key(self) -> str:
        """Bucket and key, separated by a slash."""
        return "/".join(self.parts[1:])

    def absolute(self) -> RemotePath:
        """The key itself."""
        return self

    def resolve(self, strict: bool = False) -> RemotePath:
        """The key itself: a store has no links."""
        return self

    def exists(self, *, follow_symlinks: bool = True) -> bool:
        """Whether the key exists, or one lies below it."""
        return self._type() != "NotFound"

    def is_file(self, *, follow_symlinks: bool = True) -> bool:
        """Whether the key exists."""
        return self._type() == "File"

    def is_dir(self, *, follow_symlinks: bool = True) -> bool:
        """Whether a key lies below this one."""
        return self._type() == "Directory"

    def is_symlink(self) -> bool:
        """False: a store has no links."""
        return False

    def open(self, mode: str = "r", buffering: int = -1, *arguments: Any, **named: Any) -> Any:
        """Open for reading."""
        if not set(mode) <= set("rbt"):
            raise OSError(errno.EROFS, "a key of a store is written by one upload", str(self))
        stream = io.BufferedReader(_Stream(self))
        return stream if "b" in mode else io.TextIOWrapper(stream, *arguments, **named)

    def opened(self) -> Any:
        """The key as a pyarrow file for random access."""
        with answered(self):
            return self._system().open_input_file(self.key)

    def iterdir(self) -> Generator[RemotePath, None, None]:
        """Keys and folders directly below."""
        yield from (self / entry.base_name for entry in self._below(recursive=False))

    def glob(self, pattern: str) -> Generator[RemotePath, None, None]:
        """Keys and folders directly below whose names match."""
        yield from (path for path in self.iterdir() if fnmatchcase(path.name, pattern))

    def rglob(self, pattern: str) -> Generator[RemotePath, None, None]:
        """Keys and folders below at any depth whose names match."""
        prefix = len(self.key) + 1
        below = (self / entry.path[prefix:] for entry in self._below(recursive=True))
        yield from (path for path in below if fnmatchcase(path.name, pattern))

    def files(self) -> Generator[RemotePath, None, None]:
        """Keys below at any depth, without folders."""
        prefix = len(self.key) + 1
        below = self._below(recursive=True)
        yield from (self / entry.path[prefix:] for entry in below if entry.type.name == "File")

    def modified_s(self) -> float | None:
        """Time at which the key was written, by the clock of the store [s since 1970]; None if it does not exist."""
        with answered(self):
            return self._system().get_file_info(self.key).mtime_ns / 1e9 if self.is_file() else None

    def mkdir(self, mode: int = 0o777, parents: bool = False, exist_ok: bool = False) -> None:
        """Require the bucket: a folder of a store exists with its first key.

        Raises
        ------
        StoreError
            If the bucket does not exist.
        """
        bucket = self.parts[1]
        with answered(self):
            kind = self._system().get_file_info(bucket).type.name
        if kind != "Directory":
            _absent(self)

    def unlink(self, missing_ok: bool = False) -> None:
        """Delete the key."""
        with answered(self):
            try:
                self._system().delete_file(self.key)
            except FileNotFoundError:
                if not missing_ok:
                    raise

    def rmdir(self) -> None:
        """Delete the keys below, if there are any."""
        with answered(self):
            if self._type() == "Directory":
                self._system().delete_dir(self.key)

    def upload(self, content: bytes | Path) -> None:
        """Write the key, which appears complete or not at all.

        Parameters
        ----------
        content : its bytes, or a local file that holds them.
        """
        import pyarrow as pa

        with answered(self):
            stream = self._system().open_output_stream(self.key)
            try:
                if isinstance(content, bytes):
                    stream.write(content)
                elif content.stat().st_size:
                    with pa.memory_map(str(content)) as file:
                        stream.write(file.read_buffer())
            finally:
                stream.close()

    def _type(self) -> str:
        with answered(self):
            return str(self._system().get_file_info(self.key).type.name)

    def _below(self, recursive: bool) -> list[Any]:
        from pyarrow.fs import FileSelector

        with answered(self):
            found = self._system().get_file_info(
                FileSelector(self.key, allow_not_found=True, recursive=recursive)
            )
        return sorted(found, key=lambda entry: str(entry.path))

    def _system(self) -> Any:
        return _file_system(self.parts[0].rstrip(":"), self.parts[1])


class _Stream(io.RawIOBase):
    """The bytes of a key in order; an error of the store is a `StoreError`."""

    def __init__(self, path: RemotePath) -> None:
        self._path = path
        self._file = path.opened()

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        with answered(self._path):
            return int(self._file.readinto(buffer))

    def close(self) -> None:
        self._file.close()
        super().close()


_LONGEST_NAME: Final = 255
"""Bytes of the name of a file or folder (NAME_MAX of Linux and macOS)."""


def location(path: str | os.PathLike[str]) -> Path:
    """A file or folder as a user names it: a local path, or a URL of an object store.

    Parameters
    ----------
    path : local path, file:///PATH, s3://BUCKET/KEY or gs://BUCKET/KEY.

    Returns
    -------
    Path
        A `RemotePath` for a key of a store, and a local path otherwise.

    Raises
    ------
    StoreError
        If the path is empty or has a name that no file system takes, the scheme is unknown, or the URL has no bucket or
        states options.
    """
    if isinstance(path, RemotePath):
        return path
    text = os.fspath(path)
    if not text:
        raise StoreError("the path is empty; give a file, a folder or a URL")
    longest = max(text.split("/"), key=len)
    if len(os.fsencode(longest)) > _LONGEST_NAME:
        raise StoreError(
            f"{longest[:20]}...: a name of {len(os.fsencode(longest))} bytes, and a file system takes {_LONGEST_NAME}; give a "
            "shorter one"
        )
    scheme, colon, rest = text.partition(":/")
    if not colon or len(scheme) < 2 or not scheme.isalnum() or Path(f"{scheme}:").exists():
        return Path(path)
    rest = rest.lstrip("/")
    if scheme == "file":
        return Path("/" + unquote(rest))
    if scheme not in SCHEMES:
        raise StoreError(f"{text}: no store of scheme {scheme!r}; {choices(scheme, [*SCHEMES, 'file'])}")
    split = urlsplit(f"{scheme}://{rest}")
    if not split.netloc or split.query or split.fragment or "@" in split.netloc:
        raise StoreError(
            f"{text}: is not {scheme}://BUCKET/FOLDER; the address and the credentials of a store come from the environment, "
            "see docs/stores.md"
        )
    return RemotePath(f"{scheme}:", split.netloc, *(part for part in split.path.split("/") if part))


def files_below(folder: Path) -> Iterator[Path]:
    """Files of a folder at any depth, and links."""
    if isinstance(folder, RemotePath):
        return folder.files()
    return (path for path in folder.rglob("*") if not path.is_dir() or path.is_symlink())


@contextmanager
def answered(path: RemotePath) -> Iterator[None]:
    """Turn the errors of a store into a `StoreError` with the key, the reason and the next step.

    Raises
    ------
    StoreError
        If the bucket does not exist, permission is denied, or the store does not answer.
    """
    try:
        yield
    except FileNotFoundError:
        raise FileNotFoundError(errno.ENOENT, "no such key", str(path)) from None
    except OSError as error:
        words = str(error)
        if any(word in words for word in _ABSENT):
            _absent(path)
        if isinstance(error, PermissionError) or any(word in words for word in _DENIED):
            raise StoreError(
                f"{path}: the store denies permission; give credentials that may read, list, write and delete keys there, "
                "and run the same command again"
            ) from None
        if any(word in words for word in _SILENT):
            raise StoreError(
                f"{path}: the store does not answer; what is recorded stays, and the same command continues once the store "
                "can be reached"
            ) from None
        raise StoreError(f"{path}: the store refuses ({reason(error)}); run the same command again") from None


def each(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """A function of each item, in their order; `REQUESTS` of them wait for the store at a time."""
    with ThreadPoolExecutor(REQUESTS) as pool:
        return list(pool.map(function, items))


def _absent(path: RemotePath) -> NoReturn:
    raise StoreError(
        f"{path}: there is no bucket {path.parts[1]!r}; create it and run the same command again, or choose another"
    )


@lru_cache(maxsize=8)
def _file_system(scheme: str, bucket: str) -> Any:
    """The file system of a bucket, one for each process."""
    from pyarrow.fs import FileSystem

    # pyarrow's Google client takes the address of an emulator from the environment and asks for credentials all the same
    user = "anonymous@" if scheme == "gs" and GOOGLE_EMULATOR in os.environ else ""
    return FileSystem.from_uri(f"{scheme}://{user}{bucket}{SCHEMES[scheme]}")[0]


__all__ = ["REQUESTS", "RemotePath", "answered", "each", "files_below", "location"]
