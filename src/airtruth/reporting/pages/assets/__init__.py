"""Style sheet, script and uPlot of the pages; uPlot is checked by its digest."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.resources import files
from typing import Final

from airtruth.errors import StoreError

UPLOT: Final = "1.6.32"
"""Version of uPlot in the npm registry (MIT licence)."""
INTEGRITY: Final = (
    "sha512-KIMVnG68zvu5XXUbC4LQEPnhwOxBuLyW1AHtpm6IKTXImkbLgkMy+jabjLgSLMasNuGGzQm/ep3tOkyTxpiQIw=="
)
"""Digest of the package of that version, as the registry states it; `scripts.vendor_uplot` checks it."""
DIGESTS: Final = {
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
    "LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
}
"""File of uPlot -> SHA-256 of its bytes in that package."""


@cache
def own(name: str) -> str:
    """Return a file of this folder as text."""
    return (files(__name__) / name).read_text(encoding="utf-8")


@cache
def uplot(name: str) -> str:
    """Return a file of uPlot as text.

    Raises
    ------
    StoreError
        If its bytes are not those of the published package.
    """
    content = (files(__name__) / "uplot" / name).read_bytes()
    if hashlib.sha256(content).hexdigest() != DIGESTS[name]:
        raise StoreError(f"{name} of uPlot {UPLOT} in this installation is damaged; install airtruth again")
    return content.decode("utf-8")


__all__ = ["DIGESTS", "INTEGRITY", "UPLOT", "own", "uplot"]
