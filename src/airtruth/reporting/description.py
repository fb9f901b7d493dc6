"""The description of a campaign, campaign.json: its name, title, number of runs and gust settings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from airtruth.documents import read_json
from airtruth.errors import StoreError

DESCRIPTION: Final = "campaign.json"
"""File of the campaign's name, title, number of runs and gust settings."""


@dataclass(frozen=True)
class Description:
    """The entries of campaign.json that tables show; ``runs`` is None where the file does not state it."""

    name: str
    title: str
    runs: int | None
    gust: str


def describe(folder: Path) -> Description:
    """Read campaign.json of a folder; without it the folder's name serves.

    Raises
    ------
    StoreError
        If the file is malformed.
    """
    path = folder / DESCRIPTION
    fallback = folder.resolve().name
    if not path.is_file():
        return Description(fallback, fallback, None, "")
    cure = "correct it, or remove it to use the folder's name"
    entries = read_json(path, StoreError, cure)
    if not isinstance(entries, dict):
        raise StoreError(f'{path}: holds no JSON object; expected {{"name": ..., "title": ..., ...}}')
    gust = entries.get("gust")
    words = (
        ", ".join(f"{key} {_words(value)}" for key, value in gust.items()) if isinstance(gust, dict) else ""
    )
    name = entries.get("name", fallback)
    title, runs = entries.get("title", name), entries.get("runs")
    if not (isinstance(name, str) and isinstance(title, str)):
        raise StoreError(f"{path}: name and title must be text; {cure}")
    if Path(name).name != name or not name.isprintable():
        raise StoreError(f"{path}: name {name!r} cannot be part of a file's name; leave out '/'")
    if not (runs is None or isinstance(runs, int)):
        raise StoreError(f"{path}: runs {runs!r} must be a whole number; {cure}")
    return Description(name, title or name, runs, words)


def _words(setting: object) -> str:
    """A gust setting in words: a plain value, or a distribution with its parameters."""
    if not isinstance(setting, dict):
        return str(setting)
    if set(setting) == {"value"}:
        return str(setting["value"])
    return " ".join(f"{key} {_words(value)}" for key, value in setting.items() if value is not None)


__all__ = ["DESCRIPTION", "Description", "describe"]
