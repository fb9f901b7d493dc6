"""Pages as people see them, in headless Chromium: no complaint, zoom, selector, tables, themes, and their looks.

`PYTHONPATH=. python tests/reporting/test_pages_in_browser.py` writes the pictures that the looks are compared with.
"""

import io
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from report_records import GTM, METHODS, log, loop_folder, trace_folder
from report_synthetic import TABLE_1, paper_campaign

from airtruth.identification import identify, write_estimates
from airtruth.logs.store import write_log
from airtruth.reporting import report
from scripts.browser import MISSING, browser, program

pytestmark = [
    pytest.mark.slow,
    pytest.mark.xdist_group("browser"),
    pytest.mark.skipif(program() is None, reason=MISSING),
]
PICTURES = Path(__file__).parent / "pictures"
KINDS = ("identification", "trace", "loop", "campaign")
WIDTHS = (1280, 400)
SCHEMES = ("light", "dark")
BLOCK_PX = 16
"""Side of the squares whose mean brightness is compared; a curve is thinner, a plot much larger."""
HEIGHT_PX = 2400
"""Part of the page that is compared: the answer, the picture and the plots."""
MOST_RMS, MOST_BLOCK = 0.005, 0.1
"""Largest difference in brightness, of 1: root mean square over the page, and of any square. Another release of
Chromium moves a curve by a pixel; a plot that is missing makes twice these differences (see the control)."""
FONTS = "fonts.json"
"""Width of a word in the font of the pages, by which other fonts are recognised."""


def make_pages(folder):
    """The page of each kind, and of a campaign with its logs."""
    flown = paper_campaign(folder / "campaign", "light", "table1", TABLE_1, 40, 1)
    (folder / "identified" / "logs").mkdir(parents=True)
    write_log(folder / "identified" / "logs" / "a.parquet", log(runs=6), dtype="float64")
    write_estimates(
        folder / "identified" / "estimates.parquet", identify(folder / "identified", GTM, METHODS)
    )
    sources = {
        "identification": folder / "identified",
        "trace": trace_folder(folder / "trace"),
        "loop": loop_folder(folder / "loop"),
        "campaign": flown,
    }
    return {name: report(source, folder / f"{name}.html")[0] for name, source in sources.items()}


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    return make_pages(tmp_path_factory.mktemp("pages"))


@pytest.fixture(scope="module")
def tabs(tmp_path_factory):
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


def opened(tabs, path, width=1280, scheme="light"):
    tab = tabs()
    tab.show(width, scheme=scheme)
    tab.open(path)
    return tab


def blocks(png):
    """Mean brightness of squares of a picture, 0 to 1."""
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("L"), dtype=float)[:HEIGHT_PX] / 255.0
    rows, columns = (n // BLOCK_PX for n in pixels.shape)
    cut = pixels[: rows * BLOCK_PX, : columns * BLOCK_PX]
    return cut.reshape(rows, BLOCK_PX, columns, BLOCK_PX).mean(axis=(1, 3))


def differences(one, other):
    """Root mean square and largest difference of two pictures."""
    rows = min(len(one), len(other))
    apart = np.abs(one[:rows] - other[:rows])
    return float(np.sqrt(np.mean(apart**2))), float(apart.max())


def font_width(tab):
    return tab.run(
        "(() => { const c = document.createElement('canvas').getContext('2d'); c.font = '100px system-ui, sans-serif';"
        " return c.measureText('Residual as declared').width; })()"
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_page_opens_without_a_complaint_and_looks_as_before(tabs, pages, kind, width, scheme):
    tab = opened(tabs, pages[kind], width, scheme)
    assert tab.complaints() == []
    assert tab.run("document.documentElement.scrollWidth") == width
    smallest = tab.run(
        "Math.min(...[...document.querySelectorAll('.panel > svg')].map((s) =>"
        " 11 * s.getBoundingClientRect().width / s.viewBox.baseVal.width))"
    )
    assert smallest > 8.5  # px, of 11 in the drawing
    stated = json.loads((PICTURES / FONTS).read_text())
    if font_width(tab) != pytest.approx(stated["width"], rel=0.01):
        pytest.skip(
            "the pictures were taken with another font; install fonts-dejavu-core, or take them again"
        )
    before = np.asarray(Image.open(PICTURES / f"{kind}-{width}-{scheme}.png"), dtype=float) / 255.0
    rms, largest = differences(blocks(tab.picture()), before)
    assert rms < MOST_RMS
    assert largest < MOST_BLOCK


def test_a_missing_plot_is_seen(tabs, pages):
    """Control of the comparison: one of seven plots hidden, or the other theme, is outside its bounds."""
    tab = opened(tabs, pages["trace"])
    whole = blocks(tab.picture())
    assert differences(whole, blocks(tab.picture())) == (0.0, 0.0)
    tab.run("document.querySelectorAll('.uplot canvas')[1].style.visibility = 'hidden'")
    rms, largest = differences(whole, blocks(tab.picture()))
    assert largest > 2 * MOST_BLOCK
    assert rms > 2 * MOST_RMS
    tab.run("document.getElementById('theme').click()")
    assert differences(whole, blocks(tab.picture()))[0] > 40 * MOST_RMS


def plot_box(tab, number):
    """Left, top, width and height of the data area of a plot [px], scrolled into view."""
    return tab.run(
        f"(() => {{ const p = document.querySelectorAll('.u-over')[{number}]; p.scrollIntoView({{block: 'center'}});"
        " const b = p.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })()"
    )


def readouts(tab):
    return tab.run("[...document.querySelectorAll('.readout')].map((r) => r.textContent)")


@pytest.mark.parametrize("kind", ["trace", "identification", "loop"])
def test_zoom_is_linked_across_the_channels(tabs, pages, kind):
    tab = opened(tabs, pages[kind])
    ends = "[Number(document.getElementById('from').value), Number(document.getElementById('to').value)]"
    low, high = tab.run(ends)
    assert low == 0.0
    left, top, width, height = plot_box(tab, 1)
    middle = top + 0.5 * height
    tab.drag((left + 0.2 * width, middle), (left + 0.5 * width, middle))
    zoomed = tab.run(ends)
    assert zoomed == pytest.approx([0.2 * high, 0.5 * high], abs=0.02 * high)
    for share, expected in ((0.001, zoomed[0]), (0.999, zoomed[1])):
        left, top, width, height = plot_box(tab, 3)
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=left + share * width, y=top + 0.5 * height)
        told = readouts(tab)
        assert len(told) == 7
        times = [float(words.split(" s:")[0]) for words in told]
        assert times == pytest.approx([expected] * 7, abs=0.03)
    x, y = left + 0.5 * width, top + 0.5 * height
    for count in (1, 2):
        for event in ("mousePressed", "mouseReleased"):
            tab.call("Input.dispatchMouseEvent", type=event, x=x, y=y, button="left", clickCount=count)
    assert tab.run(ends) == [low, high]
    tab.run(
        "(() => { const f = document.getElementById('to'); f.value = 2; f.dispatchEvent(new Event('change')); })()"
    )
    assert tab.run("document.getElementById('records').dataset.to") == "2.00"
    assert tab.complaints() == []


def test_the_selector_shows_each_record(tabs, pages):
    tab = opened(tabs, pages["trace"])
    names = tab.run("[...document.getElementById('record').options].map((o) => o.textContent)")
    assert names == [
        "r1 (fitted)",
        "r2 (fitted)",
        "r4 (fitted)",
        "r5 (fitted)",
        "r3 (held out)",
        "r6 (held out)",
    ]
    shown = "document.getElementById('records').dataset.record"
    assert tab.run(shown) == "r6"
    pictures = set()
    for step in range(len(names)):
        tab.run("document.getElementById('record-next').click()")
        assert tab.run(shown) == names[step].split()[0]
        assert tab.run("document.getElementById('condition').textContent").startswith(
            names[step].split("(")[1][:-1]
        )
        pictures.add(tab.run("document.querySelectorAll('.uplot canvas')[2].toDataURL()"))
    tab.run("document.getElementById('record-previous').click()")
    assert tab.run(shown) == "r3"
    assert len(pictures) == len(names)  # the ripple of a record depends on its name
    below = "(() => {{ const b = document.getElementById('below'); b.value = '{}'; b.dispatchEvent(new Event('change')); }})()"
    tab.run(below.format("innovation"))
    assert "innovation" in tab.run("document.querySelectorAll('.plot h3')[2].textContent")
    tab.run(below.format("pitch"))
    assert "pitch change [deg]" in tab.run("document.querySelectorAll('.plot h3')[4].textContent")
    tab.run(below.format("innovation"))
    button = "document.querySelector('#toggles button')"
    drawn = tab.run("document.querySelectorAll('.uplot canvas')[1].toDataURL()")
    tab.run(f"{button}.click()")
    assert tab.run(f"{button}.getAttribute('aria-pressed')") == "false"
    tab.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert tab.run("document.querySelectorAll('.uplot canvas')[1].toDataURL()") != drawn
    assert tab.complaints() == []


def test_tables_sort_and_download(tabs, pages):
    tab = opened(tabs, pages["trace"])
    table = "document.querySelector('#candidates .tablebox')"
    column = f"[...{table}.querySelectorAll('tbody tr')].map((r) => r.cells[1].textContent)"
    click = f"{table}.querySelectorAll('thead button.sort')[1].click()"
    stated = tab.run(column)
    tab.run(click)
    scores = [float(x) for x in tab.run(column) if x != "-"]
    assert scores == sorted(scores)
    assert tab.run(column)[len(scores) :] == ["-"] * (len(stated) - len(scores))
    tab.run(click)
    assert [float(x) for x in tab.run(column) if x != "-"] == sorted(scores, reverse=True)
    assert tab.run(f"{table}.querySelectorAll('th')[1].getAttribute('aria-sort')") == "descending"
    text = tab.run(
        "new Promise((done) => { URL.createObjectURL = (blob) => { blob.text().then(done); return '#'; };"
        f" {table}.querySelector('button.csv').click(); }})"
    )
    assert text.splitlines()[0] == "effect,score,p (Holm),refit gain,outcome"
    assert text.splitlines()[1].startswith("elevator_asymmetry,143.552,")


def test_the_theme_follows_the_system_and_the_button_and_paper_is_light(tabs, pages):
    background = "getComputedStyle(document.body).backgroundColor"
    tab = opened(tabs, pages["loop"], scheme="dark")
    assert tab.run(background) == "rgb(21, 24, 28)"
    tab.run("document.getElementById('theme').click()")
    assert tab.run(background) == "rgb(255, 255, 255)"
    tab.run("document.getElementById('theme').click()")
    tab.call(
        "Emulation.setEmulatedMedia",
        media="print",
        features=[{"name": "prefers-color-scheme", "value": "dark"}],
    )
    assert tab.run(background) == "rgb(255, 255, 255)"
    assert tab.run("getComputedStyle(document.querySelector('nav')).display") == "none"
    assert len(tab.call("Page.printToPDF", preferCSSPageSize=True)["data"]) > 50_000
    assert tab.complaints() == []


def take_pictures():
    """Write the pictures that the looks are compared with."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, browser(Path(folder) / "profile") as tabs:
        for kind, path in make_pages(Path(folder)).items():
            for width in WIDTHS:
                for scheme in SCHEMES:
                    tab = opened(tabs, path, width, scheme)
                    small = Image.fromarray((255.0 * blocks(tab.picture())).round().astype(np.uint8))
                    small.save(PICTURES / f"{kind}-{width}-{scheme}.png", optimize=True)
        (PICTURES / FONTS).write_text(json.dumps({"width": font_width(tab)}) + "\n")


if __name__ == "__main__":
    sys.exit(take_pictures())
