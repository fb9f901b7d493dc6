"""Tables and summaries: the contract's columns, and every number in every form."""

import csv
import io
import json
from html.parser import HTMLParser

import numpy as np
import pytest
from scipy.stats import norm

from airtruth.errors import ConfigurationError
from airtruth.identification import (
    SENTENCES,
    Options,
    Status,
    estimates_table,
    identify_batch,
    quantities,
)
from airtruth.identification.covariance_columns import correlation_names, covariance_of
from airtruth.identification.estimates import Estimates
from airtruth.identification.tables import comparison, details
from airtruth.physics.short_period import modal
from airtruth.table import Number, as_csv, as_html, as_json, as_text
from validation.linear_flight import GTM, fly

BATCH = fly(runs=5, gust=1.0, noise=1.0, seed=51)
ESTIMATES = identify_batch(BATCH, GTM, "iv-f1")
NAMES = ("CLalpha", "CLq", "CLde", "Cmalpha", "Cmq", "Cmde", "wn_rad_s", "zeta")


def test_columns_are_those_of_the_contract():
    table = estimates_table(ESTIMATES)
    expected = ["run_id", "method", "converged", "iterations"]
    for name in NAMES:
        expected += [name, f"{name}_std", f"{name}_lower", f"{name}_upper"]
    expected += ["status", *correlation_names()]
    assert table.columns.tolist() == expected
    assert table["run_id"].tolist() == list(BATCH.run_ids)
    assert table["converged"].dtype == bool
    np.testing.assert_array_equal(table["Cmq"], ESTIMATES.theta[:, 4])
    np.testing.assert_array_equal(table["wn_rad_s"], modal(ESTIMATES.theta, ESTIMATES.scale)[0])


def test_the_table_holds_covariance_and_flight_condition():
    table = estimates_table(ESTIMATES, GTM)
    np.testing.assert_allclose(covariance_of(table), ESTIMATES.covariance, rtol=1e-12)
    assert table["CLalpha_CLq_corr"].iloc[0] == pytest.approx(
        ESTIMATES.covariance[0, 0, 1] / np.sqrt(ESTIMATES.covariance[0, 0, 0] * ESTIMATES.covariance[0, 1, 1])
    )
    # q_bar S/m of the scale, from airspeed and density of the table
    pressure = 0.5 * table["density_kg_m3"] * table["airspeed_m_s"] ** 2
    np.testing.assert_allclose(pressure * GTM.wing_area_m2 / GTM.mass_kg, ESTIMATES.scale.normal, rtol=1e-12)
    np.testing.assert_array_equal(table["airspeed_m_s"], ESTIMATES.scale.airspeed_m_s)
    older = table.drop(columns=list(correlation_names()))
    assert np.isnan(covariance_of(older)).all()


@pytest.mark.parametrize("confidence", [0.68, 0.95, 0.99])
def test_intervals_are_normal(confidence):
    estimates = identify_batch(BATCH, GTM, "ls", Options(confidence=confidence))
    q = quantities(estimates)
    half = norm.ppf(0.5 + confidence / 2.0) * q.std
    np.testing.assert_allclose(q.upper - q.value, half)
    np.testing.assert_allclose(q.value - q.lower, half)
    np.testing.assert_allclose(q.std[:, :6], np.sqrt(np.einsum("rii->ri", estimates.covariance)))


def test_every_status_has_a_sentence():
    assert set(SENTENCES) == set(Status)


def test_summary_of_a_run_and_of_all():
    one = details(ESTIMATES, "run-0003")
    assert [row[0] for row in one.rows] == list(NAMES)
    assert one.rows[4][2] == ESTIMATES.theta[3, 4]
    assert "run-0003" in one.title
    every = details(ESTIMATES)
    assert every.rows[4][2] == pytest.approx(ESTIMATES.theta[:, 4].mean())
    assert every.rows[4][4] == pytest.approx(ESTIMATES.theta[:, 4].std(ddof=1))
    assert every.rows[4][3] == pytest.approx(ESTIMATES.theta[:, 4].std(ddof=1) / np.sqrt(5))


def test_a_run_that_did_not_converge_is_counted_and_kept_out_of_the_mean():
    status = ESTIMATES.status.copy()
    status[1] = Status.MAXIMUM_ITERATIONS
    changed = Estimates(**{**ESTIMATES.__dict__, "status": status})
    table = details(changed)
    assert table.title == "IV(f1), 4 of 5 runs converged"
    assert table.rows[0][2] == pytest.approx(ESTIMATES.theta[[0, 2, 3, 4], 0].mean())
    assert any(note.startswith("1 run: maximum number of iterations") for note in table.notes)


def test_forms_hold_the_same_numbers():
    table = details(ESTIMATES)
    rows = list(csv.reader(io.StringIO(as_csv(table))))
    assert tuple(rows[0]) == table.columns
    assert float(rows[3][2]) == table.rows[2][2]
    parsed = json.loads(as_json(table))
    assert parsed["title"] == table.title
    assert parsed["rows"][2]["mean"] == table.rows[2][2]

    class Cells(HTMLParser):
        count = 0
        open_tags: tuple[str, ...] = ()

        def handle_starttag(self, tag, attrs):
            self.count += tag in ("td", "th")
            self.open_tags = (*self.open_tags, tag)

        def handle_endtag(self, tag):
            assert self.open_tags[-1] == tag
            self.open_tags = self.open_tags[:-1]

    parser = Cells()
    parser.feed(as_html(table))
    assert parser.count == 6 * 9
    assert parser.open_tags == ()
    text = as_text(table).splitlines()
    assert str(Number(table.rows[0][2])) in next(line for line in text if line.startswith("CLalpha"))


def test_what_is_missing_is_a_dash_or_null():
    lost = Estimates(**{**ESTIMATES.__dict__, "theta": np.full((5, 6), np.nan)})
    table = details(lost, "run-0000")
    assert json.loads(as_json(table))["rows"][0]["estimate"] is None
    row = next(line for line in as_text(table).splitlines() if line.startswith("CLalpha"))
    assert row.split()[2] == "-"
    everything = Estimates(**{**lost.__dict__, "status": np.full(5, Status.DIVERGED, dtype=np.int8)})
    assert "0 of 5 runs converged" in details(everything).title
    assert "nan" not in as_text(details(everything))


def test_compare_methods_over_runs_and_for_one():
    ls = identify_batch(BATCH, GTM, "ls")
    table = comparison([ls, ESTIMATES])
    assert table.columns == ("parameter", "unit", "ls", "ls +-", "iv-f1", "iv-f1 +-")
    assert table.rows[0][2] == pytest.approx(ls.theta[:, 0].mean())
    values = ESTIMATES.theta[:, 0]
    assert table.rows[0][5] == pytest.approx(values.std(ddof=1) / len(values) ** 0.5)
    one = comparison([ls, ESTIMATES], "run-0002")
    assert one.rows[5][4] == ESTIMATES.theta[2, 5]
    assert one.rows[5][5] == pytest.approx(np.sqrt(ESTIMATES.covariance[2, 5, 5]))


def test_unknown_run_and_nothing_to_compare():
    with pytest.raises(ConfigurationError, match="'run-9' is not among the 5 runs"):
        details(ESTIMATES, "run-9")
