"""The lateral flight that separates effects: separations against the tracer's own fits, the campaign, and refusals."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from airtruth.design import lateral_flight, lateral_splitting
from airtruth.design.flight import PlanOptions, conditions, model_of
from airtruth.design.from_files import Request, planned_from
from airtruth.design.lateral_flight import with_input
from airtruth.design.lateral_splitting import split_lateral
from airtruth.design.limits import Limits
from airtruth.design.question import from_names, motion_of
from airtruth.design.separation import Experiment, Member
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.simulation.campaign.file import Campaign
from airtruth.starting import campaign_text
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.response import respond
from airtruth.units import DEG
from tests.simulation.fly_campaigns import command

SAMPLE = Path(__file__).resolve().parents[1] / "reporting" / "trace_sample.json"
BASE = Campaign.model_validate(tomllib.loads(campaign_text("next", "gtm")))
OPTIONS = PlanOptions(Limits(amplitude_rad=3.0 * DEG))


@pytest.fixture
def few_inputs(monkeypatch):
    monkeypatch.setattr(lateral_flight, "PATTERNS", {"3211": 7.0})
    monkeypatch.setattr(lateral_flight, "STEPS_S", ((0.4,), (0.3, 0.45)))


@pytest.mark.slow
def test_separation_is_that_of_a_nonlinear_fit(gtm):
    """Against scipy's least squares over the rival's size and all nuisance parameters, with differences of the filter itself."""
    record = lateral_splitting._record(with_input(BASE, "3211", (0.4, 0.3), 3.0 * DEG, 2), gtm)
    model = model_of(gtm, BASE, next(conditions(BASE)), 1, LATERAL)
    truth, rival = Member(EFFECTS["rudder_delay"], np.array([0.02])), EFFECTS["actuator_lag:rudder_rad"]
    experiment = Experiment(model, record)
    y = experiment.outputs(truth, model.still)
    expected = experiment.distance(y, rival, np.array([0.02]), model.still)
    told = replace(record, signals=replace(record.signals, y=y))
    hypothesis = model.hypothesis((rival,), told)
    priors = TraceProblem((told,), model.settings).priors(hypothesis)
    common, own = model.layout.common, model.layout.per_record
    shared = np.setdiff1d(np.arange(common.colour.start), common.noise)
    each = np.setdiff1d(np.arange(own.size), own.log_gust)
    roots = [
        np.linalg.cholesky(precision[np.ix_(rows, rows)]).T
        for precision, rows in ((priors.common, shared), (priors.per_record[0][1], each))
    ]
    at = model.own(record)
    white = respond(told, model.settings, model.declared, model.still, at).white

    def rows(x):
        moved, there = model.still, at.copy()
        moved[shared] = x[: len(shared)]
        there[each] += x[len(shared) : -1]
        flown = respond(told, model.settings, hypothesis.change(x[-1:]), moved, there)
        return np.concatenate(
            [(flown.e @ white.T).ravel(), roots[0] @ x[: len(shared)], roots[1] @ x[len(shared) : -1]]
        )

    start = np.append(np.zeros(len(shared) + len(each)), expected.sizes)
    found = least_squares(rows, start, x_scale="jac", diff_step=1e-5)
    print(expected, 2.0 * found.cost, found.x[-1])
    assert expected.sigma**2 == pytest.approx(2.0 * found.cost, rel=0.1)
    assert expected.sigma > 2.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "keys", [("rudder_delay", "actuator_lag:rudder_rad"), ("fin_effectiveness", "dihedral")]
)
def test_the_best_input_separates_most_and_its_campaign_flies(few_inputs, keys, tmp_path):
    found = split_lateral(BASE, from_names(keys, {}), OPTIONS)
    assert [m.effect.name for m in found.hypotheses] == [EFFECTS[k].name for k in keys]
    best, other = (min(one.values) for one in found.inputs)
    assert best > other > 0.0
    found.write(tmp_path / "next.toml")
    flown = command("fly", str(tmp_path / "next.toml"), "--dry-run", "--out", str(tmp_path / "flown"))
    assert flown.code == 0, flown.err
    again = Campaign.model_validate(tomllib.loads((tmp_path / "next.toml").read_text()))
    assert [m.control for m in (again.manoeuvre[0], *again.manoeuvre[0].also)] == ["aileron", "rudder"]
    assert found.to_dict()["separation_sigma"] == best
    assert found.to_frame().shape == (2, 4)


@pytest.mark.slow
def test_more_records_separate_more(few_inputs):
    names = from_names(("vane_arm:beta_rad", "vane_lag:beta_rad"), {"vane_arm:beta_rad.x_m": 0.6})
    few, many = (split_lateral(BASE, names, replace(OPTIONS, records=n)) for n in (6, 60))
    assert few.fitted == 4
    assert many.fitted == 40
    assert many.least > 2.0 * few.least


def test_effects_of_one_motion_have_a_flight():
    assert motion_of([EFFECTS["rudder_delay"], EFFECTS["mass_error"]]) is LATERAL
    assert motion_of([EFFECTS["elevator_delay"], EFFECTS["mass_error"]]) is LONGITUDINAL
    with pytest.raises(ConfigurationError, match="rudder_delay on the lateral motion"):
        from_names(("rudder_delay", "elevator_delay"), {})
    with pytest.raises(ConfigurationError, match="derivatives"):
        from_names(("derivatives:lateral", "rudder_delay"), {})


@pytest.mark.slow
def test_a_tied_lateral_answer_asks_for_this_flight(few_inputs, tmp_path):
    answer = json.loads(SAMPLE.read_text())
    own = answer["effects"][1] | {
        "name": "rudder_delay",
        "parameters": {"delay_s": {"value": 0.03, "std": 0.004, "ci95": [0.022, 0.038]}},
        "indistinguishable_from": ["actuator_lag"],
    }
    rival = next(c for c in answer["candidates"] if c["testable"])
    answer["effects"] = [own]
    answer["candidates"] = [rival | {"name": "actuator_lag", "variant": "rudder_rad", "why_not": ""}]
    answer["derivatives"]["declared"] = dict.fromkeys(LATERAL.parameters, 0.1)
    (tmp_path / "trace.json").write_text(json.dumps(answer))
    found = planned_from(BASE, Request(trace=tmp_path), "gtm", OPTIONS)
    assert [m.effect.key for m in found.hypotheses] == ["rudder_delay", "actuator_lag:rudder_rad"]
    assert found.hypotheses[0].values["delay_s"] == pytest.approx(0.03)
