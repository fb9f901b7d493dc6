"""Real flights that the project does not hold; tests are skipped, saying so, where they are absent."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(os.environ.get("AIRTRUTH_MEASURED", ROOT.parent / "shared" / "measured"))


@pytest.fixture(scope="session")
def measured():
    """Path of a measured file by name."""

    def path(name: str) -> Path:
        if not (FOLDER / name).is_file():
            pytest.skip(
                f"no measured flight {FOLDER / name}; set AIRTRUTH_MEASURED to the folder that holds it"
            )
        return FOLDER / name

    return path
