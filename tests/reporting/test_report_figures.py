"""Figures: what is drawn is what was given, in the units of the labels, and nothing hides the data."""

from itertools import pairwise

import matplotlib
import numpy as np
import pytest
import report_synthetic as synthetic
from matplotlib.backends.backend_agg import FigureCanvasAgg

from airtruth import style
from airtruth.errors import StoreError
from airtruth.physics import short_period
from airtruth.reporting import read_campaign
from airtruth.reporting.paper import published
from studies import paper_distribution as distribution
from studies import paper_figures as figures

TRUTH = synthetic.TRUTH[:6]


@pytest.fixture(scope="module")
def matrices():
    """The paper's truth at the GTM's condition: TAS 42.85 m/s, density 0.9931 kg/m3."""
    return short_period.system(TRUTH, short_period.scale(0.5483, 0.27898, 26.195, 6.314, 42.85, 0.9931))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures") / "moderate"
    status = {("iv-f2", 9): "maximum iterations", ("iv-f2", 11): "diverged"}
    return read_campaign(
        synthetic.paper_campaign(
            folder, "moderate", "table3", synthetic.TABLE_3, 60, 1, failed=(3,), status=status
        )
    )


def channels(scale):
    t = np.arange(250) / 50.0
    names = ("elevator_command_rad", "elevator_rad", "alpha_rad", "q_rad_s", "az_m_s2")
    return t, {name: scale * np.sin((i + 1) * t) for i, name in enumerate(names)}


def flight():
    t, measured = channels(0.1)
    return figures.flight(t, {"measured": measured, "calm air": channels(0.2)[1]}, "Run r00001")


def outputs():
    t = np.arange(200) / 50.0
    y = np.array([0.05 * np.sin(t), np.cos(t), 0.2 * np.sin(2 * t)])
    fit = figures.OutputFit(y, 0.9 * y, np.array([[0.01], [0.1], [0.02]]))
    return figures.outputs(t, {"LS": fit, "IV (f1)": fit}, "Run r00001")


def drawn(figure):
    canvas = FigureCanvasAgg(figure)
    with style.applied():
        canvas.draw()
    return canvas.get_renderer()


def test_flight_shows_degrees():
    figure = flight()
    assert len(figure.axes) == 5
    for ax, name in zip(figure.axes, channels(0.1)[1], strict=True):
        for line, scale in zip(ax.lines, (0.1, 0.2), strict=True):
            t, expected = channels(scale)
            factor = 1.0 if name == "az_m_s2" else np.pi / 180.0
            np.testing.assert_array_equal(line.get_xdata(), t)
            np.testing.assert_allclose(line.get_ydata() * factor, expected[name], rtol=1e-14)
        assert ("deg" in ax.get_ylabel()) == (name != "az_m_s2")


def test_flight_leaves_out_what_no_version_has():
    t, measured = channels(1.0)
    some = {name: measured[name] for name in ("alpha_rad", "q_rad_s")}
    figure = figures.flight(t, {"measured": some, "calm air": {"alpha_rad": measured["alpha_rad"]}})
    assert [len(ax.lines) for ax in figure.axes] == [2, 1]


def test_filter_responses_are_those_of_the_state_space_model(matrices):
    """q/de = [0 1](jw I - A)^-1 B and 1/det(jw I - A), computed by solving the linear system."""
    a, b = matrices
    omega = np.logspace(-1, 3, 50)
    f1, f2 = figures.filter_responses(a, b, omega)
    for w, one, two in zip(omega, f1, f2, strict=True):
        pencil = 1j * w * np.eye(2) - a
        assert one == pytest.approx(1.0 / np.linalg.det(pencil), rel=1e-12)
        assert two == pytest.approx(-np.linalg.solve(pencil, b)[1], rel=1e-12)


def test_filters_look_like_the_papers_figure_1(matrices):
    """Fig. 1: to 1000 rad/s, where f1 is at -120 dB; f2 the larger; phases from 0 to -180 and -90 deg."""
    magnitude, phase = figures.filters(*matrices).axes
    (f1, f2), (p1, p2) = ([line.get_ydata() for line in ax.lines] for ax in (magnitude, phase))
    assert f1[-1] == pytest.approx(-120.0, abs=0.1)
    assert (f2 > f1).all()
    assert f1[0] == pytest.approx(-20.0 * np.log10(6.632**2), abs=0.1)  # 1/wn^2, the paper's truth
    assert (p1[0], p1[-1]) == (pytest.approx(0.0, abs=1.0), pytest.approx(-180.0, abs=1.0))
    assert (p2[0], p2[-1]) == (pytest.approx(0.0, abs=3.0), pytest.approx(-90.0, abs=1.0))


def test_outputs_show_bounds_about_the_estimate():
    figure = outputs()
    axes = np.reshape(figure.axes, (3, 2))
    for ax in axes[0]:
        measured, estimated = (line.get_ydata() for line in ax.lines)
        np.testing.assert_allclose(estimated, 0.9 * measured, rtol=1e-12)
        band = ax.collections[0].get_paths()[0].vertices[:, 1]
        expected = [np.min(estimated) - np.rad2deg(0.01), np.max(estimated) + np.rad2deg(0.01)]
        np.testing.assert_allclose([band.min(), band.max()], expected, rtol=1e-12)
    assert np.max(axes[2, 0].lines[0].get_ydata()) <= 0.2  # in g, as given
    assert [ax.get_title() for ax in axes[0]] == ["LS", "IV (f1)"]


def test_estimates_show_truth_published_and_every_run(campaign):
    figure = distribution.estimates(campaign, printed=[published.load().tables["table3"]])
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["true value", "estimates: quartiles, 5-95 %", "published mean ± standard deviation"]
    for j, ax in enumerate(figure.axes):
        assert ax.lines[0].get_xdata()[0] == pytest.approx(synthetic.TRUTH[j], rel=1e-14)
        for method, box in zip(campaign.estimates, ax.patches, strict=True):
            x = campaign.estimates[method].values[:, j]
            q1, q3 = np.quantile(x[np.isfinite(x)], (0.25, 0.75))
            assert (box.get_x(), box.get_width()) == pytest.approx((q1, q3 - q1))
    assert [tick.get_text() for tick in figure.axes[0].get_yticklabels()] == list(synthetic.TABLE_3)


def test_a_method_takes_the_first_table_that_has_it(campaign):
    tables = published.load().tables
    figure = distribution.estimates(campaign, ["ls", "iv-f1"], [tables["table1"], tables["table3"]])
    centres = [
        container[0].get_xdata()[0]
        for container in figure.axes[0].containers
        if hasattr(container, "has_xerr")
    ]
    # CLalpha: LS of Table 1, IV (f1) of Table 3
    assert centres == [4.101, 4.726]


def test_runs_outside_the_frame_are_counted(campaign):
    figure = distribution.estimates(campaign)
    words = [text.get_text() for ax in figure.axes for text in ax.texts]
    assert words  # run 9 of iv-f2 lies 50 times too far
    assert set(words) == {"1 outside"}
    for j, ax in enumerate(figure.axes):
        left, right = ax.get_xlim()
        x = np.concatenate([e.values[:, j] for e in campaign.estimates.values()])
        assert np.sum((x < left) | (x > right)) == len(ax.texts)


def test_estimates_with_no_finite_run_leave_their_row_empty(tmp_path):
    values = synthetic.draw_paper("table3", ("ls", "iv-f1"), 10, seed=1)
    values["iv-f1"][:] = np.nan
    folder = synthetic.write_campaign(
        tmp_path, synthetic.truth_columns(10), synthetic.estimate_columns(values)
    )
    figure = distribution.estimates(read_campaign(folder))
    assert [len(ax.patches) for ax in figure.axes] == [1] * 6


@pytest.mark.grid
@pytest.mark.parametrize("kind", ["flight", "filters", "outputs", "estimates"])
def test_the_legend_hides_no_data_and_no_text_is_cut(kind, matrices, campaign):
    figure = {
        "flight": flight,
        "outputs": outputs,
        "filters": lambda: figures.filters(*matrices, "GTM"),
        "estimates": lambda: distribution.estimates(
            campaign, None, [published.load().tables["table3"]], "Moderate"
        ),
    }[kind]()
    renderer = drawn(figure)
    legend = figure.legends[0].get_window_extent(renderer)
    assert figure.axes
    for ax in figure.axes:
        assert not legend.overlaps(ax.get_tightbbox(renderer))
        ticks = [label.get_window_extent(renderer) for label in ax.get_xticklabels() if label.get_visible()]
        ticks = [
            box for box in ticks if ax.get_window_extent(renderer).padded(2).x0 <= box.x0 and box.width > 1
        ]
        assert all(left.x1 < right.x0 for left, right in pairwise(ticks))
    page = figure.bbox
    for box in (legend, *(ax.get_tightbbox(renderer) for ax in figure.axes)):
        assert box.x0 >= page.x0 - 1
        assert box.x1 <= page.x1 + 1
        assert box.y0 >= page.y0 - 1
        assert box.y1 <= page.y1 + 1


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_saved_figures_are_the_same_bytes_each_time(tmp_path, suffix, matrices):
    for name in ("one", "two"):
        style.save(figures.filters(*matrices), tmp_path / f"{name}.{suffix}")
    one, two = ((tmp_path / f"{name}.{suffix}").read_bytes() for name in ("one", "two"))
    assert one == two
    assert len(one) > 5000


def test_other_formats_are_refused(tmp_path, matrices):
    with pytest.raises(StoreError, match="no figure format 'gif'; allowed: pdf, png, svg"):
        style.save(figures.filters(*matrices), tmp_path / "x.gif")


def test_drawing_leaves_matplotlib_as_it_was(matrices):
    before = dict(matplotlib.rcParams)
    figure = figures.filters(*matrices)
    assert dict(matplotlib.rcParams) == before
    assert figure.canvas.manager is None  # not one of pyplot's
