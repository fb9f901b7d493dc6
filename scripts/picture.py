"""The picture of README: a simulated flight test of a damaged tail in calm air, traced.

python -m scripts.picture [--out docs/images/trace.png]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Final

import airtruth as at
from airtruth import style
from airtruth.starting.texts import campaign_text
from airtruth.tracing.presentation.match_figure import match_figure

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""
EFFECT: Final = """
[[effect]]
name = "tail_effectiveness"
factor = 0.7
"""
"""The horizontal tail has lost 30 % of its lift."""
CANDIDATES: Final = ("tail_effectiveness", "wing_effectiveness", "cg_shift", "vane_scale", "derivatives")
"""Effects that are compared, as in docs/gallery/lost_tail.md."""


def main() -> None:
    """Fly, trace and draw."""
    parser = argparse.ArgumentParser(description="Draw the picture of README.")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images" / "trace.png")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text = campaign_text("tail").replace('level = "light"', 'level = "none"')
        (folder / "tail.toml").write_text(text + EFFECT)
        flown = at.fly(folder / "tail.toml", folder / "tail")
        traced = at.trace(flown.folder, "gtm", at.TraceOptions(effects=CANDIDATES))
        print(traced.summary().splitlines()[0])
        style.save(match_figure(traced.histories), given.out)


if __name__ == "__main__":
    main()
