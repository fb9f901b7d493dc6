"""Headline, agreement, frequency response and correlation of a page: by hand and against independent computation."""

import base64
import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import report_samples
from matplotlib.figure import Figure
from report_records import GTM, METHODS, answer, histories, log
from scipy.stats import binom, t

from airtruth.identification import identify
from airtruth.physics.proof_of_match import OF_CHANNEL
from airtruth.reporting.pages.agreement import agreement_table
from airtruth.reporting.pages.frequency_page import frequency_section, response_chart
from airtruth.reporting.pages.headline import headline
from airtruth.reporting.pages.records import records_section
from airtruth.reporting.pages.result_page import result_report
from airtruth.reporting.pages.scatter_page import (
    correlation_section,
    scattered_correlations,
    stated_correlations,
)
from airtruth.reporting.statistics import (
    Counts,
    MethodStatistics,
    RelativeError,
    Statistic,
    difference,
    influence,
)
from airtruth.table import WIDTH, significant
from airtruth.tracing.presentation.charts import innovations_chart, scores_chart, trace_chart
from airtruth.tracing.presentation.match_figure import match_figure

TRUTH = np.array([4.8, 30.0, 0.5, -1.8, -41.0, -1.9])


def statistics(errors, hits):
    """Statistics of methods from their errors (runs, 6)."""
    n = len(next(iter(errors.values())))
    own = {m: influence(e, e.mean(axis=0), TRUTH, n) for m, e in errors.items()}
    empty = Statistic(np.full(8, math.nan), np.full(8, math.nan))
    return {
        m: MethodStatistics(
            counts=Counts(n, 0, n, 0, 0, 0, {}),
            mean=empty,
            std=empty,
            rmse=empty,
            coverage=Statistic(np.r_[np.array(hits[m]) / n, 1.0, 1.0], np.zeros(8)),
            median=np.zeros(8),
            mad=np.zeros(8),
            relerr=report_samples.relative_error(e, TRUTH),
            relerr_modal=empty,
            iterations=Statistic(np.array(0.0), np.array(0.0)),
            correlation=np.eye(6),
            products={other: float(own[m] @ own[other]) for other in errors},
        )
        for m, e in errors.items()
    }


def errors_of(bias, seed, n=40):
    return bias * np.abs(TRUTH) + np.random.default_rng(seed).normal(size=(n, 6)) * 0.05 * np.abs(TRUTH)


ALL = {"ls": [40] * 6, "iv-f1": [40] * 6}


def test_a_significant_difference_is_the_headline():
    shown = headline(statistics({"ls": errors_of(0.3, 1), "iv-f1": errors_of(0.0, 1)}, ALL), 40, 40)
    assert shown[0].startswith("iv-f1 is nearest to the truth: RelErr ")
    assert shown[-1].startswith("RelErr: norm of the mean error")


def test_a_difference_within_the_scatter_is_not():
    shown = headline(statistics({"ls": errors_of(0.0, 1), "iv-f1": errors_of(0.0, 2)}, ALL), 40, 40)
    assert shown[0].startswith("These runs do not tell which method is nearest to the truth")
    assert len(shown) == 2


def test_failing_intervals_belong_to_the_headline():
    """0 of 40 fails; 36 of 40 has a probability of 0.14 and does not (binomial, 95 %)."""
    hits = {"ls": [40, 40, 40, 0, 40, 40], "iv-f1": [36] * 6}
    assert binom.cdf(36, 40, 0.95) == pytest.approx(0.138, abs=1e-3)
    shown = headline(statistics({"ls": errors_of(0.0, 1), "iv-f1": errors_of(0.0, 2)}, hits), 40, 41)
    assert "(ls: Cmalpha 0 of 40)" in shown[1]
    assert shown[-1].endswith("40 of 41 runs flew.")


def test_the_paired_error_is_that_of_the_jackknife():
    """Leave-one-out pseudo-values of the difference of two RelErr agree with the delta method within a few percent."""
    one, other = errors_of(0.2, 3, 200), errors_of(0.2, 4, 200) * 0.7 + 0.3 * errors_of(0.2, 3, 200)
    n = len(one)
    found = statistics({"a": one, "b": other}, {"a": [n] * 6, "b": [n] * 6})
    products = (found["a"].products["a"], found["b"].products["b"], found["a"].products["b"])
    value, error = difference(found["a"].relerr.value, found["b"].relerr.value, products, n)

    def size(e):
        return np.linalg.norm(e.mean(axis=0)) / np.linalg.norm(TRUTH)

    left = np.array([size(np.delete(one, i, 0)) - size(np.delete(other, i, 0)) for i in range(n)])
    jackknife = math.sqrt((n - 1) / n * ((left - left.mean()) ** 2).sum())
    assert value == pytest.approx(size(one) - size(other), rel=1e-12)
    assert error == pytest.approx(jackknife, rel=0.02)
    assert 0.0 < t.sf(abs(value) / error, n - 1) < 1.0
    assert isinstance(found["a"].relerr, RelativeError)


def test_the_table_of_agreement_pools_the_held_out_records():
    whole = histories()
    held = [r for r in whole.records if r.group == "held out"]
    table = agreement_table(whole)
    assert table.title == f"Agreement of the simulations over {len(held)} held-out records"
    z = np.concatenate([r.measured["q_rad_s"] - r.measured["q_rad_s"].mean() for r in held])
    y = np.concatenate([r.models["after"]["q_rad_s"] - r.measured["q_rad_s"].mean() for r in held])
    rows = next(g for g in table.groups if g.heading == "q").rows
    row = dict(zip(table.columns, rows[2], strict=True))
    assert float(row["R2"]) == pytest.approx(1.0 - ((z - y) ** 2).sum() / (z**2).sum(), rel=1e-9)
    assert float(row["U"]) == pytest.approx(
        np.linalg.norm(z - y) / (np.linalg.norm(z) + np.linalg.norm(y)), rel=1e-9
    )


def test_the_plots_state_tolerances_in_their_units():
    page = records_section(histories()).body
    data = json.loads(page.split('id="records-data">')[1].split("</script>")[0])
    assert data["tolerances"] == pytest.approx([0.0, 2.0, 0.1 * 9.80665])
    assert [kind for _, kind in data["keys"]] == ["measured", "tolerance", "band"]
    assert set(OF_CHANNEL) == {"q_rad_s", "az_m_s2", "p_rad_s", "r_rad_s"}


def test_the_pitch_of_the_plots_is_the_integral_of_q_with_its_tolerance():
    """q = A cos(w t) has the pitch A/w sin(w t); the limits are 1.5 deg from the measured one (Part 60, 2.c.10)."""
    given = histories()
    t, w = given.first.t_s, 3.0

    def turned(run, amplitude):
        return {**run, "q_rad_s": amplitude * np.cos(w * t)}

    records = tuple(
        replace(
            r,
            measured=turned(r.measured, 0.2),
            models={m: turned(own, 0.1) for m, own in r.models.items()},
        )
        for r in given.records
    )
    body = records_section(replace(given, records=records)).body
    data = json.loads(body.split('id="records-data">')[1].split("</script>")[0])
    assert '<option value="pitch">' in body
    assert data["pitch"] == {"channel": "q [deg/s]", "tolerance": pytest.approx(1.5)}
    for stated in data["records"]:
        measured, *models = (np.frombuffer(base64.b64decode(x), dtype="<f4") for x in stated["pitch"])
        assert len(models) == len(given.models)
        # trapezoidal rule: relative error (w dt)^2/12 = 3e-4 at 50 Hz
        for found, amplitude in ((measured, 0.2), *((m, 0.1) for m in models)):
            exact = np.rad2deg(amplitude / w * np.sin(w * t))
            np.testing.assert_allclose(found, exact, rtol=0, atol=4e-4 * np.rad2deg(amplitude / w))
        low, high = (measured + side * data["pitch"]["tolerance"] for side in (-1.0, 1.0))
        assert (high - low) == pytest.approx(np.full(len(t), 3.0))
        # 0.1/3 rad = 1.91 deg apart at most: the simulation leaves the corridor
        assert ((models[0] < low) | (models[0] > high)).any()


def test_pitch_is_offered_only_where_q_was_recorded():
    def without(run):
        return {c: x for c, x in run.items() if c != "q_rad_s"}

    given = histories()
    records = tuple(
        replace(r, measured=without(r.measured), models={m: without(own) for m, own in r.models.items()})
        for r in given.records
    )
    body = records_section(replace(given, records=records)).body
    assert '<option value="pitch">' not in body


def test_the_frequency_response_of_a_known_model_lies_on_the_measurement():
    result = identify(log(runs=6), GTM, METHODS)
    chart = response_chart(result.histories())
    assert [p.y_label for p in chart.panels] == ["q/elevator [dB]", "az/elevator [dB]"] + 2 * [
        "phase [deg]"
    ] + 2 * ["coherence [-]"]
    measured, model = (np.array(chart.panels[0].lines[k].y) for k in (0, 1))
    kept = np.isfinite(measured)
    assert kept.sum() >= 4
    assert np.median(np.abs(measured - model)[kept]) < 2.0  # dB, of a response that spans 15 dB
    noise = np.random.default_rng(1)
    lone = tuple(
        replace(r, measured={c: noise.normal(size=len(r.t_s)) for c in r.measured})
        for r in histories().records
    )
    assert "No frequency response is shown" in frequency_section(replace(histories(), records=lone)).body


def test_correlations_are_those_of_the_covariance_and_of_the_scatter():
    result = identify(log(runs=13), GTM, ["ls"])
    stated = stated_correlations(result.to_frame())["ls"]
    mean = result.of("ls").covariance.mean(axis=0)
    assert stated[0, 1] == pytest.approx(mean[0, 1] / math.sqrt(mean[0, 0] * mean[1, 1]), rel=1e-12)
    scatter = scattered_correlations(result.to_frame())["ls"]
    np.testing.assert_allclose(scatter, np.corrcoef(result.of("ls").theta, rowvar=False), rtol=1e-9)
    (chart,), section = correlation_section({"ls": stated})
    assert len(list(chart.panels[0].cells.each())) == 36
    assert "Correlation of the estimates" in section.body
    assert correlation_section({})[1].body == ""


def test_a_none_answer_shows_the_record_and_its_residuals():
    plain = replace(
        histories(models=("declared", "before")),
        records=tuple(replace(r, effect={}) for r in histories(models=("declared", "before")).records),
    )
    drawn = trace_chart(answer(), plain)
    assert drawn.columns == 2
    assert len(drawn.panels) == 6
    assert not any(panel.words for panel in drawn.panels)
    assert [label for label, _ in drawn.entries()][:3] == ["measured", "before", "declared"]
    assert "derivatives and noise levels refitted" in drawn.caption


def test_no_model_hides_another_in_the_innovations():
    drawn = innovations_chart(histories())
    assert drawn.columns == 3
    series = [panel for panel in drawn.panels if panel.x_label == "time [s]"]
    assert all(len(panel.lines) == 1 for panel in series)
    assert series[0].y_range() == series[1].y_range()


def test_the_figure_states_why_a_passed_line_is_not_enough():
    whole = answer()
    passed = [c for c in whole.candidates if c.why_not and c.p_value_alone < 1e-6]
    caption = scores_chart(whole).caption
    assert all(f"{c.key} ({c.why_not})" in caption for c in passed)


class Plain:
    """A result with a summary of every kind of line."""

    def summary(self):
        return "\n".join(["Heading +- 1", "=======", "word " * 40, "a  " * 60])

    def to_frame(self):
        return pd.DataFrame({"x": [1.0]})

    def plot(self):
        return Figure()


def test_the_page_of_a_result_shows_its_picture_first_and_cuts_no_sentence():
    page = result_report(Plain()).page
    assert "Heading \u00b1 1" in page
    assert page.index("<img") < page.index("<pre>")
    text = page.split("<pre>")[1].split("</pre>")[0].splitlines()
    assert max(len(line) for line in text[:-1]) <= WIDTH
    assert text[-1].startswith("a  a  a")
    assert not any(set(line) == {"="} for line in text)


def test_the_picture_of_readme_shows_measurement_models_and_residuals():
    whole = histories()
    figure = match_figure(whole)
    assert len(figure.axes) == 6
    record = whole.first
    signals = figure.axes[2].lines
    assert len(signals) == 3
    shown = np.asarray(signals[1].get_ydata()) * math.pi / 180.0
    assert np.isin(np.round(shown, 9), np.round(record.models["declared"]["alpha_rad"], 9)).all()
    words = [t.get_text() for ax in figure.axes for t in ax.texts]
    before, after = (math.degrees(record.rms(m, "q_rad_s")) for m in ("declared", "after"))
    assert f"rms {significant(before, 2)} \u2192 {significant(after, 2)} deg/s" in words
