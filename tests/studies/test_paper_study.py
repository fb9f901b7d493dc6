"""The paper study: how it varies a campaign, and what it finds without noise."""

import re
from dataclasses import replace

import numpy as np
import pytest

from airtruth.logs.store import read_table
from airtruth.reporting.paper.tables import Entry
from airtruth.simulation.campaign import file as campaign_file
from airtruth.table import as_markdown
from airtruth.units import DEG
from studies import paper_cases as cases
from studies import paper_study as study

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def small(gtm, tmp_path_factory):
    return cases.Study(tmp_path_factory.mktemp("study"), jobs=1, quick=True, gtm=gtm)


def calm(**changes):
    return replace(cases.Case("", u=0.0, w=0.0, extra=cases.IDEAL), **changes)


def test_settings_replace_values_of_the_shipped_campaigns():
    text = (cases.CAMPAIGNS / "light-fit.toml").read_text(encoding="utf-8")
    new = cases.with_settings(text, {"factor": "3.0", "duration_s": "5.0"})
    assert re.findall(r"(?m)^factor = (.*)$", new) == ["3.0"]
    assert re.findall(r"(?m)^duration_s = (.*)$", new) == ["5.0"]
    with pytest.raises(KeyError, match="fctor appears 0 times"):
        cases.with_settings(text, {"fctor": "3.0"})


@pytest.mark.parametrize("name", ["light", "moderate"])
def test_best_setting_differs_from_the_plain_campaign_in_manoeuvre_and_length_alone(name):
    fit = campaign_file.read(cases.CAMPAIGNS / f"{name}-fit.toml")
    plain = campaign_file.read(cases.CAMPAIGNS / f"{name}.toml")
    same = {"name": "", "title": "", "seed": 0, "duration": 5.0, "manoeuvre": ()}
    assert fit.model_copy(update=same) == plain.model_copy(update=same)
    assert fit.manoeuvre[0].amplitude.value == pytest.approx(1.0 * DEG)


@pytest.mark.long
def test_gust_components_are_switched_in_the_plan(small):
    folder = cases.flown(small, calm(), runs=1)
    plan = read_table(folder / "plan.parquet")
    assert (plan["sigma_u_m_s"] == 0.0).all()
    assert (plan["sigma_w_m_s"] == 0.0).all()
    both = read_table(cases.flown(small, cases.Case("", w=0.5), runs=1) / "plan.parquet")
    # the GTM's light gains: sigma_u 0.2 * 5.829 m/s, sigma_w 0.17 * 4.775 m/s (GTM_DesignSim)
    assert both["sigma_u_m_s"][0] == pytest.approx(0.2 * 5.829, rel=1e-3)
    assert both["sigma_w_m_s"][0] == pytest.approx(0.5 * 0.17 * 4.775, rel=1e-3)


def test_record_is_cut_and_the_command_replaced(small):
    folder = cases.flown(small, calm(), runs=1)
    whole = next(cases.records(folder, calm()))
    cut = next(cases.records(folder, calm(from_s=2.0, lead_s=0.02)))
    assert cut.t_s[0, 0] == pytest.approx(2.0)
    elevator = whole.channels["elevator_rad"][0, 100:]
    assert np.allclose(cut.channels["elevator_command_rad"][0, :-1], elevator[1:], rtol=0.0, atol=1e-15)


def test_both_breaks_as_regressors_recover_cmalpha(small):
    folder = cases.flown(small, calm(), runs=1)
    truth = read_table(folder / "truth.parquet").iloc[0]
    batch = next(cases.records(folder, calm()))
    plain, free = (study.moment_fit(batch, truth, small.gtm, breaks) for breaks in (False, True))
    # local slope at the trim from truth.parquet; the break at 6 deg costs a plain fit a tenth of it
    assert free[0] == pytest.approx(truth["Cmalpha"], rel=0.01)
    assert abs(plain[0] / truth["Cmalpha"] - 1.0) > 0.1


def test_shown_rounds_to_the_error():
    assert study.shown(Entry("ls", "CLq", "mean", 88.4567, 2.345)) == "88.5 ± 2.3"
    assert study.shown(Entry("ls", "", "iterations", 2.0)) == "2"


@pytest.mark.long
def test_misfit_is_the_rms_of_z_over_the_printed_columns(small):
    tables = study.tables_of(small, cases.SETTINGS[0])
    z = [tables[0].entries["ls", p, "mean"].z for p in study.LONGITUDINAL.parameters]
    assert study.misfit(tables, "light", ["ls"])[0] == pytest.approx(np.sqrt(np.mean(np.square(z))))
    text = as_markdown(study.comparison_table(small, cases.SETTINGS[0]))
    assert "iv-actuator-regressor, 30 of 30 runs" in text
