"""The flight that separates two effects: separations against the tracer's own fits, the search, files and refusals."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import airtruth as at
from airtruth import cli
from airtruth.api.plans import base_campaign
from airtruth.design import search as searching
from airtruth.design import splitting
from airtruth.design.bench import Bench
from airtruth.design.criterion import criterion
from airtruth.design.flight import PlanOptions
from airtruth.design.limits import Limits
from airtruth.design.question import from_names
from airtruth.design.separation import Experiment, FilterSetting, Member
from airtruth.design.split_result import split_probability
from airtruth.design.verdict import asked_by
from airtruth.design.waveforms import multistep
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError
from airtruth.result import Result
from airtruth.simulation.campaign.plan import make
from airtruth.simulation.simulator import Condition
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.parameters import SHORT_PERIOD, Parameters
from airtruth.tracing.model.settings import declared_change, settings_of
from airtruth.units import DEG, FT, KT

SAMPLE = Path(__file__).resolve().parents[1] / "reporting" / "trace_sample.json"
LIMITS = Limits(length_s=3.0)


@pytest.fixture(scope="module")
def bench(gtm):
    return Bench(gtm, base_campaign(None, False, "gtm"), Condition(75.0 * KT, 7000.0 * FT), LIMITS)


@pytest.fixture(scope="module")
def model(gtm):
    return FilterSetting(settings_of(gtm, 0.05), declared_change(gtm), 0.3, 1)


def flown(bench, unit=0.3, sign=1.0):
    return bench.fly(multistep((3.0, 2.0, 1.0, 1.0), unit, 0.0, bench.dt_s, sign))


@pytest.mark.slow
def test_separation_is_that_of_two_fits_of_the_tracer(bench, model):
    """Twice the difference of the costs of both hypotheses, each fitted by the tracer's optimiser, levels held."""
    record = flown(bench).record
    truth = Member(EFFECTS["elevator_delay"], np.array([0.007]))
    experiment = Experiment(model, record)
    still = np.zeros(SHORT_PERIOD.common.size)
    y = experiment.outputs(truth, still)
    rival = EFFECTS["gyro_lag"]
    expected = experiment.distance(y, rival, np.array([0.005]), still)
    # priors about the truth, as the separation has them
    problem = TraceProblem((replace(record, signals=replace(record.signals, y=y)),), model.settings)
    costs = []
    for effect, size in ((truth.effect, 0.007), (rival, float(expected.sizes[0]))):
        hypothesis = Hypothesis(model.declared, (effect,), trim_flow_rad=record.plant.trim_alpha_rad)
        start = Parameters(still, model.own(record)[None], np.array([size]))
        ended = fit(problem, hypothesis, start, free_levels=False)
        costs.append(ended.cost - 0.5 * sum(len(s.r) * s.logdet for s in ended.sensitivities))
    assert expected.sigma**2 == pytest.approx(2.0 * (costs[1] - costs[0]), rel=0.05)
    assert expected.sigma > 3.0


def test_an_effect_does_not_separate_from_itself(bench, model):
    experiment = Experiment(model, flown(bench).record)
    truth = Member(EFFECTS["vane_lag"], np.array([0.02]))
    still = np.zeros(SHORT_PERIOD.common.size)
    y = experiment.outputs(truth, still)
    found = experiment.distance(y, truth.effect, np.array([0.005]), still)
    assert found.sigma < 0.05
    assert found.sizes == pytest.approx(truth.sizes, rel=0.02)


def test_separation_grows_with_the_root_of_the_records_beyond_the_priors(bench, model):
    record, still = flown(bench).record, np.zeros(SHORT_PERIOD.common.size)
    truth = Member(EFFECTS["elevator_delay"], np.array([0.01]))
    sigma = []
    for records in (100, 400):
        experiment = Experiment(replace(model, records=records), record)
        y = experiment.outputs(truth, still)
        sigma.append(experiment.distance(y, EFFECTS["actuator_lag"], np.array([0.01]), still).sigma)
    assert sigma[1] / sigma[0] == pytest.approx(2.0, rel=0.03)


def test_flights_keep_the_limits(gtm):
    limits = Limits(amplitude_rad=4.0 * DEG, alpha_rad=1.5 * DEG, load_factor=(0.7, 1.2), length_s=3.0)
    bench = Bench(gtm, base_campaign(None, False, "gtm"), Condition(75.0 * KT, 7000.0 * FT), limits)
    found = bench.fly(multistep((3.0, 2.0, 1.0, 1.0), 0.3, 0.0, bench.dt_s))
    assert 0.9 < found.reached.share(limits) <= 1.0 + 1e-9
    assert found.manoeuvre.amplitude_rad < limits.amplitude_rad
    slow = bench.fly(found.manoeuvre, 0.5)
    assert slow.reached.elevator_rad == pytest.approx(0.5 * found.reached.elevator_rad, rel=1e-3)


def test_probability_of_one_name_is_that_of_draws():
    rng = np.random.default_rng(3)
    gain = 4.0**2 + 2.0 * 4.0 * rng.standard_normal(400_000)
    assert split_probability(4.0) == pytest.approx((gain > 6.0).mean(), abs=2e-3)


def test_tied_effects_of_a_trace_are_the_hypotheses():
    answer = TraceAnswer.read(SAMPLE)
    first, *others = asked_by(answer, "trace.json")
    assert first.effect.key == "gyro_lag"
    (tau,) = first.sizes
    assert tau == pytest.approx(answer.effects[1].parameters["tau_s"].value)
    assert {h.effect.name for h in others} == {"sensor_delay"}
    assert all(h.sizes is None for h in others)
    alone = replace(answer, effects=answer.effects[:1], alternatives=(), verdict="traced", provisional=False)
    with pytest.raises(ConfigurationError, match="no two effects are tied"):
        asked_by(alone, "trace.json")


def test_sizes_are_read_in_any_unit():
    first, second = from_names(["elevator_delay", "actuator_lag"], {"elevator_delay.delay_ms": 12.0})
    assert first.sizes == pytest.approx([0.012])
    assert second.sizes is None
    lag = from_names(["elevator_delay", "actuator_lag"], {"actuator_lag.bandwidth_hz": 10.0})[1]
    assert lag.sizes == pytest.approx([1.0 / (2.0 * math.pi * 10.0)])


@pytest.mark.parametrize(
    ("keys", "sizes", "words"),
    [
        (["elevator_delay"], {}, "state two with --split A,B"),
        (["elevator_delay", "gust_level"], {}, "act on the gusts alone"),
        (["elevator_delay", "nothing"], {}, "nothing"),
        (["derivatives", "elevator_delay"], {}, "every hypothesis refits them"),
        (["elevator_delay", "actuator_lag"], {"gyro_lag.tau_s": 1.0}, "EFFECT.PARAMETER=VALUE"),
        (["elevator_delay", "actuator_lag"], {"elevator_delay.delay_s": 9.0}, "outside its range"),
    ],
)
def test_questions_that_no_flight_answers_are_refused(keys, sizes, words):
    with pytest.raises(ConfigurationError, match=words):
        from_names(keys, sizes)


def test_an_effect_that_cannot_imitate_the_first_has_its_typical_size(bench, model):
    """At its neutral value it would be no effect, and the separation from it zero."""
    record = flown(bench).record
    hypotheses = from_names(["vane_arm", "gyro_lag"], {})
    judged = criterion(model, hypotheses, record, bench.plant.derivative_cov, 0)
    (lag,) = EFFECTS["gyro_lag"].parameters
    assert judged.members[1].sizes == pytest.approx([4.0 * lag.material])
    assert judged.rate(flown(bench)).min() > 0.5
    imitating = from_names(["elevator_delay", "actuator_lag"], {})
    (bandwidth,) = EFFECTS["actuator_lag"].parameters
    found = criterion(model, imitating, record, bench.plant.derivative_cov, 0).members[1].sizes[0]
    assert found == pytest.approx(imitating[0].sizes[0], rel=0.3)  # a lag of about the delay
    assert found >= bandwidth.material


@pytest.mark.parametrize("name", ["next.png", "next"])
def test_a_file_from_which_no_campaign_flies_is_refused_before_the_search(name, tmp_path):
    with pytest.raises(ConfigurationError, match="--out"):
        at.plan(split=("elevator_delay", "actuator_lag"), aircraft="gtm", out=tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_an_option_without_a_name_is_refused():
    run = CliRunner().invoke(cli.app, ["plan", "--derivative", ",", "--aircraft", "gtm"])
    assert run.exit_code != 0


@pytest.fixture
def quick(monkeypatch):
    """A search of a few inputs."""
    monkeypatch.setattr(searching, "_CHILDREN", 8)
    monkeypatch.setattr(searching, "_UNITS", 2)


@pytest.mark.slow
def test_command_line_writes_a_campaign_that_flies(quick, tmp_path):
    out = tmp_path / "next.toml"
    line = [
        "plan",
        "--split",
        "elevator_delay,actuator_lag",
        "--aircraft",
        "gtm",
        "--out",
        str(out),
        "--json",
    ]
    line += ["--length-s", "3", "--size", "elevator_delay.delay_ms=10", "--rate-deg-s", "60", "--quiet"]
    run = CliRunner().invoke(cli.app, line)
    assert run.exit_code == 0, run.output
    facts = json.loads(run.stdout)
    assert facts["separation_sigma"] >= facts["reference_sigma"] > 0.0
    assert facts["reached"]["rate_rad_s"] <= 60.0 * DEG * (1.0 + 1e-9)
    planned = make(out)
    assert planned.campaign.runs == facts["records"]
    assert planned.campaign.effect == ()
    assert out.with_suffix(".png").stat().st_size > 10_000
    flown = at.fly(out, tmp_path / "flown", runs=1)
    assert not flown.failures
    again = CliRunner().invoke(cli.app, line)
    assert again.exit_code == 0, again.output
    assert json.loads(again.stdout) == facts


@pytest.mark.slow
def test_every_form_of_the_result_agrees(quick, tmp_path):
    campaign = base_campaign(None, False, "gtm")
    result = at.plan(campaign, split=("vane_scale", "gyro_scale"), records=3, limits=LIMITS)
    assert isinstance(result, Result)
    assert result.fitted == 2
    frame = result.to_frame()
    assert frame["least"].max() == result.best.least == result.to_dict()["separation_sigma"]
    assert [row[0] for row in result.table().rows] == frame["family"].tolist()
    assert "standard deviations" in result.summary()
    assert "<table" in result._repr_html_()
    figure = result.plot()
    assert len(figure.axes) == 4
    assert len(figure.legends) == 1
    assert not any(ax.get_legend() for ax in figure.axes), "a legend hides a curve"
    assert result.prediction.difference.shape == (len(result.prediction.t_s), 3)


@pytest.mark.slow
def test_a_range_of_airspeeds_is_compared(quick, gtm):
    campaign = base_campaign(None, False, "gtm")
    table = campaign.condition.model_validate({"eas_kt": {"choose": [65.0, 85.0]}, "altitude_ft": 7000.0})
    tried = []
    result = splitting.split(
        campaign.model_copy(update={"condition": table}),
        from_names(["elevator_delay", "actuator_lag"], {}),
        PlanOptions(LIMITS, 3),
        gtm,
        tried.append,
    )
    assert sum("EAS" in line for line in tried) == 2
    assert result.condition.eas_m_s in (pytest.approx(65.0 * KT), pytest.approx(85.0 * KT))


def test_a_trace_without_a_campaign_states_the_condition(tmp_path):
    with pytest.raises(ConfigurationError, match="--aircraft"):
        at.plan(trace=SAMPLE)
    with pytest.raises(ConfigurationError, match="nothing to plan"):
        at.plan()
    run = CliRunner().invoke(cli.app, ["plan"])
    assert run.exit_code != 0
