"""Theme of the figures: matplotlib's own settings stay as they are, and pictures survive their way into HTML."""

import base64
import re

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

from airtruth import style


@style.themed
def drawing(height: float) -> Figure:
    """A line in a panel."""
    figure, axes = style.panels(2, 3, width_in=3.0, height_in=height, sharex=True)
    assert axes.shape == (2, 3)
    assert matplotlib.rcParams["axes.grid"]
    axes[0, 0].plot([0.0, 1.0], [0.0, height], label="one")
    style.legend_above(figure, axes.flat, "title")
    return figure


def test_a_themed_function_leaves_the_settings_of_matplotlib_unchanged():
    before = dict(matplotlib.rcParams)
    figure = drawing(2.0)
    assert drawing.__doc__ == "A line in a panel."
    assert dict(matplotlib.rcParams) == before
    assert figure.get_size_inches() == pytest.approx([3.0, 2.0])


def test_the_settings_are_restored_after_an_error():
    before = dict(matplotlib.rcParams)

    @style.themed
    def failing() -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        failing()
    assert dict(matplotlib.rcParams) == before


@pytest.mark.slow
def test_a_figure_is_embedded_with_its_caption_escaped():
    png = style.as_png(drawing(2.0))
    assert png.startswith(b"\x89PNG")
    assert png == style.as_png(drawing(2.0))
    page = style.as_html(png, 'a < b & "c"')
    data = re.search(r"base64,([^\"]+)\"", page)
    assert data is not None
    assert base64.b64decode(data[1]) == png
    assert page.count("a &lt; b &amp; &quot;c&quot;") == 2


def test_the_palette_has_six_colours_that_differ_in_lightness_or_hue():
    """Okabe and Ito (2008): no two of these colours share their RGB values within 40 of 255 in every channel."""
    rgb = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in style.PALETTE])
    distance = np.abs(rgb[:, None] - rgb[None]).max(axis=2)
    assert (distance[np.triu_indices(6, 1)] > 40).all()
