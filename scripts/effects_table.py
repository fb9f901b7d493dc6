"""Write the table of the library's effects into docs/effects.md.

python -m scripts.effects_table
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from airtruth.effects.listing import as_markdown
from airtruth.effects.registry import EFFECTS

PAGE: Final = Path(__file__).resolve().parents[1] / "docs" / "effects.md"
"""The page that has the table."""
_BEGIN: Final = "<!-- effects: begin -->\n"
_END: Final = "<!-- effects: end -->"


def with_table(page: str) -> str:
    """The page with the table of the present library between its two marks.

    Parameters
    ----------
    page : text of the page.
    """
    before, rest = page.split(_BEGIN)
    _, after = rest.split(_END)
    return f"{before}{_BEGIN}{as_markdown(EFFECTS.values())}\n{_END}{after}"


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
