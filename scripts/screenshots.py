"""Pictures of every kind of page in headless Chromium, at 1280 and 400 px, light and dark (see `make browser`).

    python -m scripts.screenshots --out DIR [PAGE.html ...]

Without pages it makes one of each kind: an identification, a campaign, a trace with each verdict, a loop, a check and
a plan (some minutes). A folder that exists already in DIR is used again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import airtruth as at
from airtruth.starting import campaign_text
from scripts.browser import MISSING, browser, program

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""
WIDTHS: Final = (1280, 400)
"""Widths of the window [px]: a desk and a telephone."""
SCHEMES: Final = ("light", "dark")
"""Themes."""
SLICE_PX: Final = 2200
"""Height of a picture [px]; a longer page is cut into several, so that its type stays legible."""
LOGS: Final = {"traced": "b", "learned": "g", "one-of": "a"}
"""Kind of a trace -> its log in data/undeclared."""


def make_pages(folder: Path) -> dict[str, Path]:
    """Kind -> page; results that are in the folder already are not made again."""
    folder.mkdir(parents=True, exist_ok=True)
    undeclared = ROOT / "data" / "undeclared"
    log = str(undeclared / "b.parquet")
    results: dict[str, Callable[[Path], object]] = {
        "campaign": _campaign,
        "identification": lambda out: at.identify(log, "gtm", ["ls", "iv-f1"]),
        "loop": lambda out: at.close_loop(log, "gtm", ["ls", "iv-f1"], out=out) and out,
        **{
            f"trace-{kind}": lambda out, name=name: (
                at.trace(undeclared / f"{name}.parquet", "gtm", out=out) and out
            )
            for kind, name in LOGS.items()
        },
        "trace-none": lambda out: at.trace(folder / "campaign", "gtm", out=out) and out,
        "check": lambda out: at.check(log, "gtm"),
        "plan": lambda out: at.plan(folder / "campaign.toml", records=6),
    }
    pages = {}
    for kind, make in results.items():
        out = folder / kind
        source = out if out.is_dir() else make(out)
        pages[kind] = at.report(source, folder / f"{kind}.html")[0]
        print(pages[kind], flush=True)
    return pages


def _campaign(out: Path) -> Path:
    file = out.with_suffix(".toml")
    command = [sys.executable, "-m", "airtruth"]
    file.write_text(campaign_text("campaign"))
    at.fly(file, out)
    chosen = ["--aircraft", "gtm", "--method", "ls", "--method", "iv-f1", "--quiet"]
    subprocess.run([*command, "identify", str(out), *chosen], check=True)
    return out


def take(pages: dict[str, Path], out: Path) -> None:
    """Write the pictures of pages into a folder as KIND-WIDTH-SCHEME-NUMBER.png."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as profile, browser(Path(profile)) as tabs:
        for kind, page in pages.items():
            for width in WIDTHS:
                for scheme in SCHEMES:
                    tab = tabs()
                    tab.show(width, scheme=scheme)
                    tab.open(page)
                    height = int(tab.call("Page.getLayoutMetrics")["cssContentSize"]["height"])
                    for number, top in enumerate(range(0, height, SLICE_PX)):
                        area = (0, top, width, min(SLICE_PX, height - top))
                        (out / f"{kind}-{width}-{scheme}-{number}.png").write_bytes(tab.picture(area=area))
                    for complaint in tab.complaints():
                        print(f"{page}: {complaint}", file=sys.stderr)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the pages, unless some are given, and take their pictures."""
    parser = argparse.ArgumentParser(description="Pictures of pages in headless Chromium.")
    parser.add_argument("pages", nargs="*", type=Path, help="pages; without one, one of each kind is made")
    parser.add_argument("--out", type=Path, required=True, help="folder of the pictures and of the pages")
    given = parser.parse_args(arguments)
    if program() is None:
        print(MISSING, file=sys.stderr)
        return 1
    take({page.stem: page for page in given.pages} or make_pages(given.out / "pages"), given.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
