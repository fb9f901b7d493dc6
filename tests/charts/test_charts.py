"""Charts as data: scales and ticks by hand; both writers draw the values where they belong."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.charts import (
    Area,
    Band,
    Bar,
    Cells,
    Chart,
    Line,
    Mark,
    Panel,
    Rule,
    as_figure,
    as_html,
    colours_of,
)
from airtruth.charts.ticks import label, log_ticks, ticks

WILD = st.one_of(st.floats(), st.sampled_from([math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 0.0]))


@pytest.mark.parametrize(
    ("ends", "expected"),
    [
        ((0.0, 10.0), [0, 2, 4, 6, 8, 10]),
        ((-0.3, 0.7), [-0.2, 0.0, 0.2, 0.4, 0.6]),
        ((1234.0, 1238.0), [1234, 1235, 1236, 1237, 1238]),
        ((2e-9, 9e-9), [2e-9, 4e-9, 6e-9, 8e-9]),
    ],
)
def test_ticks_are_round(ends, expected):
    np.testing.assert_allclose(ticks(*ends), expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("value", "step", "words"),
    [(0.2, 0.2, "0.2"), (-0.0, 0.5, "0.0"), (1e-7, 1e-7, "1.0e-07"), (20.0, 10.0, "20"), (-5.0, 5.0, "-5")],
)
def test_labels(value, step, words):
    assert label(value, step) == words


@given(low=st.floats(-1e29, 1e29), width=st.floats(1e-9, 1e29))
def test_ticks_lie_within_any_scale(low, width):
    high = low + width
    if high - low <= 1e-9 * abs(low):
        return
    found = ticks(low, high)
    assert 2 <= len(found) <= 12
    slack = 1e-6 * (high - low)
    assert all(low - slack <= t <= high + slack for t in found)


def chart(**panel):
    return Chart("name", "A < B", (Panel(x_label="x", **panel),), 1)


def test_a_line_is_drawn_to_scale():
    """The curve runs from the left to the right edge of the data; y carries a margin of 6 % of its range."""
    page = as_html(chart(y_label="y", lines=(Line((0.0, 1.0, 2.0), (0.0, 10.0, 5.0)),)))
    path = re.search(r'<path d="([^"]+)" class="line"', page).group(1)
    points = np.array(re.findall(r"[ML]([\d.]+) ([\d.]+)", path), dtype=float)
    np.testing.assert_allclose(points[1, 0] - points[0, 0], points[2, 0] - points[1, 0], atol=0.11)
    down = points[:, 1]
    assert (down[0] - down[2]) / (down[0] - down[1]) == pytest.approx(0.5, abs=2e-3)
    grid = [float(x) for x in re.findall(r'class="grid" x1="([\d.]+)" x2="\1"', page)]
    assert (grid[0], grid[-1]) == pytest.approx((points[0, 0], points[2, 0]), abs=0.11)


def test_a_gap_interrupts_the_line():
    page = as_html(chart(lines=(Line((0.0, 1.0, 2.0, 3.0), (0.0, math.nan, 1.0, 2.0)),)))
    path = re.search(r'<path d="([^"]+)" class="line"', page).group(1)
    assert re.sub(r"[^ML]", "", path) == "MML"


def test_a_mark_states_its_numbers():
    page = as_html(chart(rows=("a<b",), marks=(Mark(0, 1.5, 1.0, 2.25),), rules=(Rule(0.0),)))
    assert "<title>1.5 [1, 2.25]</title>" in page
    assert "a&lt;b" in page
    assert "A &lt; B" in page


def test_the_words_of_a_bar_stay_in_the_panel():
    page = as_html(
        chart(rows=("a", "b"), bars=(Bar(0, 20.0, words="gains 10"), Bar(1, 1.0, words="gains 1")))
    )
    anchors = dict(re.findall(r'text-anchor="(\w+)">gains (\d+)', page))
    assert anchors == {"end": "10", "start": "1"}


def test_the_legend_names_each_label_once():
    panel = Panel(
        lines=tuple(Line((0.0, 1.0), (k, k), "same") for k in (0.0, 1.0)),
        bands=(Band(0.0, 1.0, label="band"),),
    )
    both = Chart("n", "t", (panel, panel), 2)
    assert [words for words, _ in both.entries()] == ["same", "band"]
    assert as_html(both).count(">same</span>") == 1
    legend = as_figure(both).legends[0]
    assert sorted(t.get_text() for t in legend.get_texts()) == ["band", "same"]


def test_the_figure_draws_the_same_values():
    panel = Panel(
        rows=("a", "b"),
        marks=(Mark(0, 1.0, 0.5, 1.5, widest=(0.0, 3.0)), Mark(1, 2.0)),
        bars=(Bar(1, 4.0, words="w"),),
        rules=(Rule(2.5),),
    )
    (ax,) = as_figure(Chart("n", "t", (panel,), 1)).axes
    assert [tick.get_text() for tick in ax.get_yticklabels()] == ["a", "b"]
    assert ax.yaxis_inverted()
    dots = [line.get_xydata()[0].tolist() for line in ax.lines if line.get_marker() == "o"]
    assert dots == [[1.0, 0.0], [2.0, 1.0]]
    assert ax.patches[0].get_width() == 4.0


@given(values=st.lists(WILD, min_size=8, max_size=8))
def test_any_number_is_drawn_or_left_out(values):
    """Numbers that are not finite, or beyond any scale, leave no trace of themselves in the page."""
    a, b, c, d, e, f, g, h = values
    panel = Panel(
        y_label="y",
        lines=(Line((a, b, c, d), (e, f, g, h)), Line((0.0, 1.0), (a, b), stroke="points")),
        bands=(Band(a, b), Band(c, d, axis="x")),
        rules=(Rule(e), Rule(f, axis="y")),
    )
    rows = Panel(rows=("r",), marks=(Mark(0, a, b, c, widest=(d, e)),), bars=(Bar(0, f, words="w"),))
    page = as_html(Chart("n", "t", (panel, rows), 2))
    drawn = re.sub(r"<title>[^<]*</title>|<text[^>]*>[^<]*</text>", "", page)
    assert not re.search(r"\bnan\b|\binf\b", drawn)


def test_the_figure_states_its_caption():
    """A figure stands alone in the folder of a trace: the shaded range and the record are explained in it."""
    figure = as_figure(Chart("n", "t", (Panel(),), 1, caption="Shaded: " + "noise " * 40))
    caption = figure.get_supxlabel()
    assert caption.split() == ["Shaded:", *["noise"] * 40]
    assert max(map(len, caption.splitlines())) < 110


def test_marks_of_two_colours_have_two_shapes():
    panel = Panel(
        rows=("a", "b"),
        marks=(Mark(0, 1.0, label="before", colour="vermillion"), Mark(1, 2.0, label="after")),
    )
    drawn = Chart("n", "t", (panel,), 1)
    assert [line.get_marker() for line in as_figure(drawn).axes[0].lines] == ["s", "o"]
    page = as_html(drawn)  # each twice: in the legend and in the panel
    assert (page.count("<polygon"), page.count("<circle")) == (2, 2)


def test_a_small_mark_is_half_as_large():
    marks = (Mark(0, 1.0), Mark(0, 2.0, small=True))
    drawn = Chart("n", "t", (Panel(rows=("a",), marks=marks),), 1)
    large, small = as_figure(drawn).axes[0].lines
    assert small.get_markersize() == 0.5 * large.get_markersize()
    assert re.findall(r' r="([\d.]+)"', as_html(drawn)) == ["3.5", "1.75"]


def test_the_labels_of_a_narrow_panel_stay_apart():
    """Labels of five characters beside each other: six are the most in a panel of 3.3 inches."""
    panel = Panel(rows=("ls", "iv-f1"), marks=(Mark(0, -37.9, -47.2, -29.1), Mark(1, -37.8, -46.2, -29.7)))
    ax = as_figure(Chart("n", "t", (panel,) * 4, 4)).axes[0]
    low, high = ax.get_xlim()
    assert sum(low <= at <= high for at in ax.get_xticks()) <= 6


def test_log_ticks_are_one_two_and_five():
    np.testing.assert_allclose(
        10.0 ** np.array(log_ticks(math.log10(0.15), math.log10(6.0))), [0.2, 0.5, 1, 2, 5]
    )


def test_a_scale_never_has_a_single_tick():
    """A range about zero whose round numbers are all outside but zero itself."""
    assert len(ticks(-0.9, 0.95, most=1)) >= 2


def test_an_area_has_a_gap_where_a_value_is_missing():
    area = Area((0.0, 1.0, 2.0, 3.0, 4.0), (0.0, 0.0, math.nan, 0.0, 0.0), (1.0,) * 5, "band")
    assert [len(piece) for piece in area.pieces()] == [2, 2]
    page = as_html(chart(areas=(area,), lines=(Line((0.0, 4.0), (0.0, 1.0)),)))
    assert re.search(r'<path d="M[^Z]+ZM[^Z]+Z" class="area"', page)
    figure = as_figure(chart(areas=(area,), lines=(Line((0.0, 4.0), (0.0, 1.0)),)))
    assert len(figure.axes[0].collections) == 2


def test_a_matrix_states_its_numbers_in_both_media():
    cells = Cells(("a", "b"), ((1.0, -0.5), (-0.5, math.nan)))
    drawn = Chart("m", "Matrix", (Panel(rows=("a", "b"), cells=cells),), 1)
    page = as_html(drawn)
    assert re.findall(r'class="cell"[^>]*>([^<]+)<', page) == ["1.00", "\u22120.50", "\u22120.50"]
    assert page.count('fill="var(--vermillion)"') == 2
    ax = as_figure(drawn).axes[0]
    assert [t.get_text() for t in ax.texts] == ["1.00", "\u22120.50", "\u22120.50"]
    assert [t.get_text() for t in ax.get_xticklabels()] == ["a", "b"]


def test_the_last_model_has_the_first_colour():
    assert colours_of(("declared", "before", "after")) == {
        "after": "blue",
        "before": "vermillion",
        "declared": "green",
    }
