"""Checks of a command before its imports of seconds: names, and whether the files exist."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib.metadata import entry_points
from pathlib import Path

from airtruth.cli.completion import METHOD_NAMES
from airtruth.errors import ConfigurationError, choices


def require_names(
    logs: Sequence[Path] = (),
    aircraft: str | None = None,
    methods: Iterable[str] = (),
    effects: Iterable[str] = (),
) -> None:
    """Refuse what does not exist, with the message that the function behind the command has for it.

    Of the libraries it imports numpy, pydantic and the core of pyarrow. Keys of object stores are left to that function, because
    they need the network.

    Parameters
    ----------
    logs : files and folders of flight logs.
    aircraft : folder, file or name of an aircraft; None for none.
    methods : names of estimators.
    effects : names or keys of effects.

    Raises
    ------
    ConfigurationError, AircraftError, StoreError
        Naming the first that does not exist.
    """
    _require_methods(methods)
    local = [path for path in logs if ":/" not in str(path)]
    if local:
        from airtruth.logs.sources import sources

        sources(local)
    if aircraft is not None:
        from airtruth.aircraft.loading import find

        find(aircraft)
    for name in effects:
        from airtruth.effects.registry import listed

        listed(name)


def _require_methods(methods: Iterable[str]) -> None:
    unknown = [name for name in methods if name not in METHOD_NAMES]
    if unknown and not entry_points(
        group="airtruth.methods"
    ):  # an estimator of another package may have the name
        raise ConfigurationError(f"method {unknown[0]!r} does not exist: {choices(unknown[0], METHOD_NAMES)}")


def require_file(path: Path, what: str, step: str) -> None:
    """Refuse a file that does not exist.

    Parameters
    ----------
    path : the file; a key of an object store is not looked up.
    what, step : what the file should be, and what the user can do.

    Raises
    ------
    ConfigurationError
        If there is none.
    """
    if ":/" not in str(path) and not path.exists():
        raise ConfigurationError(f"{path}: no such {what}; {step}")


__all__ = ["require_file", "require_names"]
