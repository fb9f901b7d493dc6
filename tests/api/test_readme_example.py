"""The Python example of the README shows every verb; tests/studies/test_documents_run.py runs it."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 15


def example() -> str:
    """The first Python block of the README."""
    (block, *_) = re.findall(
        r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL
    )
    return block


def test_the_example_shows_every_verb_in_fifteen_lines() -> None:
    block = example()
    assert len(block.splitlines()) <= LONGEST
    for verb in ("fly", "read_log", "check", "identify", "trace", "close_loop", "report"):
        assert f"at.{verb}(" in block
