"""The flight that determines derivatives or narrows a band: standard errors against other computations, files, verdicts."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim
from typer.testing import CliRunner

import airtruth as at
from airtruth import cli
from airtruth.api.plans import base_campaign
from airtruth.cli.completion import complete_derivative
from airtruth.design import BandQuestion, DerivativeQuestion, PlanOptions, forecast
from airtruth.design import search as searching
from airtruth.design.bench import Bench
from airtruth.design.from_files import Stated, planned_from
from airtruth.design.information import LinearExperiment
from airtruth.design.limits import Limits
from airtruth.design.separation import flown_by
from airtruth.design.verdict import asked_by
from airtruth.design.waveforms import multistep, repeated
from airtruth.effects.increment import Shape
from airtruth.errors import ConfigurationError
from airtruth.identification.likelihood.fit import fit as filter_error
from airtruth.identification.likelihood.options import FilterOptions
from airtruth.physics import short_period
from airtruth.physics.gust_figures import GustScales
from airtruth.physics.motion import LONGITUDINAL
from airtruth.result import Result
from airtruth.simulation.campaign.plan import make
from airtruth.simulation.manoeuvres import sample
from airtruth.simulation.simulator import Condition
from airtruth.tracing.accepted import AcceptedEffect, IncrementState, IncrementTable, ParameterEstimate
from airtruth.tracing.answer import Z95, CandidateScore, TraceAnswer
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.parameters import SHORT_PERIOD, Parameters
from airtruth.units import DEG, FT, KT
from validation.linear_flight import AIRSPEED_M_S, GTM, LIGHT, NOISE, THETA, fly

SAMPLE = Path(__file__).resolve().parents[1] / "reporting" / "trace_sample.json"
LIMITS = Limits(length_s=3.0)
SHAPE = Shape("Cm", "alpha", 0.03, 0.17, 4, 0.11)


@pytest.fixture(scope="module")
def campaign():
    return base_campaign(None, False, "gtm")


@pytest.fixture(scope="module")
def bench(gtm, campaign):
    return Bench(gtm, campaign, Condition(75.0 * KT, 7000.0 * FT), LIMITS)


@pytest.fixture(scope="module")
def flown(bench):
    return bench.fly(multistep((3.0, 2.0, 1.0, 1.0), 0.3, 0.0, bench.dt_s))


def accepted(std=0.004):
    """A learned break of Cm over alpha: three bends, of which the last is known least, and no slope at the trim."""
    bends, stds = np.array([0.01, 0.0, -0.02, 0.0]), std * np.array([1.0, 1.0, 3.0, 0.0])
    at_rad = np.linspace(SHAPE.low, SHAPE.high, SHAPE.cells + 1)
    basis = SHAPE.basis(at_rad)
    value, half = basis @ bends, Z95 * np.sqrt(basis**2 @ stds**2)
    return AcceptedEffect(
        name="increment",
        variant=SHAPE.variant,
        parameters={
            name: ParameterEstimate(b, s, (None, None))
            for name, b, s in zip(SHAPE.coefficients, bends.tolist(), stds.tolist(), strict=True)
        },
        p_value=1e-9,
        separation_sigma=9.0,
        acts_on="Cm",
        over="alpha_rad",
        table=IncrementTable(
            *(tuple(x.tolist()) for x in (at_rad, value, value - half, value + half)), samples=(9,) * 5
        ),
    )


def behind(state, **of_memory):
    """A learned linear increment of Cm, a share of 0.3 behind a state."""
    return AcceptedEffect(
        name="increment",
        variant=f"Cm over a {state.kind} of {state.signal}",
        parameters={"share": ParameterEstimate(0.3, 0.1, (None, None)), **of_memory},
        p_value=1e-9,
        separation_sigma=9.0,
        acts_on="Cm",
        over=state.signal,
        states=(state,),
    )


def test_standard_errors_are_those_of_a_dense_fisher_information(gtm, bench, flown):
    """Output error of the linear equations, differenced in derivatives, initial state and biases; scipy flies them."""
    channels, noise = flown.channels, {"alpha_rad": 0.002, "q_rad_s": 0.005, "az_m_s2": 0.1}
    still = GustScales(0.0, 0.0, 300.0, 300.0)
    experiment = LinearExperiment(gtm, noise, still, bench.trim.airspeed_m_s, bench.log_dt_s, "rest")
    theta = bench.plant.derivatives
    found = experiment.least_covariance(channels, theta)
    c = gtm.constants
    density = float(channels["density_kg_m3"].mean())
    scale = short_period.scale(
        c.wing_area_m2, c.chord_m, c.mass_kg, c.inertia_yy_kg_m2, bench.trim.airspeed_m_s, density
    )
    elevator = channels["elevator_rad"] - channels["elevator_rad"][0]
    t_s = bench.log_dt_s * np.arange(len(elevator))

    def outputs(x):
        a, b = short_period.system(x[:6], scale)
        row = short_period.normal_force_row(x[:6], scale)
        system = (a, b[:, None], np.vstack([np.eye(2), row[:2]]), np.array([[0.0], [0.0], [row[2]]]))
        y = lsim(system, elevator, t_s, X0=x[6:8])[1] + x[8:]
        return (y / np.array(list(noise.values()))).ravel()

    x = np.concatenate([theta, np.zeros(5)])
    steps = 1e-4 * np.concatenate([np.abs(theta), np.ones(5)])
    slopes = np.stack(
        [(outputs(x + h) - outputs(x - h)) / (2.0 * s) for h, s in zip(np.diag(steps), steps, strict=True)]
    )
    expected = np.linalg.inv(slopes @ slopes.T)[:6, :6]
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.sqrt(np.diag(expected)), rtol=0.03)


@pytest.mark.slow
def test_a_band_is_that_of_the_tracers_fit(bench, campaign, flown):
    """Two equal records fitted by the tracer's optimiser from the truth: the covariance of the bends at its end."""
    band = BandQuestion((accepted(),)).at(bench, campaign, 2, 0)
    assert band.model.records == 2
    (own,) = band.learned
    still = np.zeros(SHORT_PERIOD.common.size)
    found = band.covariance(flown.record, 1.0, still)
    hypothesis = Hypothesis(
        band.model.declared,
        (own.effect,),
        also_unconstrained=tuple(range(6)),
        trim_flow_rad=flown.record.plant.trim_alpha_rad,
    )
    record = flown_by(band.model, flown.record, hypothesis, own.sizes, still)
    problem = TraceProblem((record, record), band.model.settings)
    start = Parameters(still, np.stack([band.model.own(record)] * 2), own.sizes)
    ended = fit(problem, hypothesis, start, free_levels=False)
    np.testing.assert_allclose(ended.point.sizes, own.sizes, atol=1e-4)
    expected = ended.covariance[SHORT_PERIOD.common.size :, SHORT_PERIOD.common.size :]
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.sqrt(np.diag(expected)), rtol=0.02)


def test_a_band_and_a_flight_are_combined_by_their_inverse_variances(bench, campaign, flown):
    """One draw, by hand; points of no band, in the cell of the trim without a slope, do not count."""
    band = BandQuestion((accepted(),)).at(bench, campaign, 3, 0)
    band = replace(band, draws=((1.0, np.zeros(SHORT_PERIOD.common.size)),))
    (own,) = band.learned
    assert own.at == pytest.approx([0.03, 0.065, 0.17])
    (found,) = band.expected(flown, final=True)
    covariance = band.covariance(flown.record, 1.0, np.zeros(SHORT_PERIOD.common.size))
    alone = np.diag(own.basis @ covariance @ own.basis.T)
    np.testing.assert_allclose(found**2, alone * own.known**2 / (alone + own.known**2), rtol=1e-9)
    assert band.rate(flown)[0] == pytest.approx(
        math.sqrt((own.known**2).mean() / (found**2).mean()), rel=1e-9
    )


def test_points_in_the_cell_of_the_trim_do_not_count(bench, campaign):
    """There the band is that of the slope, which the flight cannot tell from a derivative."""
    whole = accepted()
    half = 0.002
    table = replace(
        whole.table,
        low=tuple(v - half for v in whole.table.value),
        high=tuple(v + half for v in whole.table.value),
        trim=SHAPE.trim,
    )
    (own,) = BandQuestion((replace(whole, table=table),)).at(bench, campaign, 3, 0).learned
    assert own.at == pytest.approx([0.03, 0.065, 0.17])


def test_a_table_of_many_cells_is_planned_for_with_eight(bench, campaign):
    """A straight line above the trim, in 24 cells: nine points of it, and a bend in the cell beside the trim alone."""
    at = np.linspace(0.03, 0.17, 25)
    value = -0.4 * np.maximum(at - 0.1, 0.0)
    whole = accepted()
    table = IncrementTable(
        tuple(at.tolist()),
        tuple(value.tolist()),
        tuple((value - 0.002).tolist()),
        tuple((value + 0.002).tolist()),
        (9,) * 25,
        0.0925,
    )
    (own,) = BandQuestion((replace(whole, table=table),)).at(bench, campaign, 3, 0).learned
    assert own.effect.shape.cells == 8
    np.testing.assert_allclose(own.at, [0.03, 0.0475, 0.065, 0.1175, 0.135, 0.1525, 0.17], atol=1e-12)
    np.testing.assert_allclose(own.value, -0.4 * np.maximum(own.at - 0.1, 0.0), atol=1e-12)
    np.testing.assert_allclose(own.basis @ own.sizes, own.value, atol=1e-12)
    np.testing.assert_allclose(own.known, 0.002 / Z95)


def test_a_learned_play_keeps_its_half_width(bench, campaign):
    """A play without a half width leaves the flight no sensitivity to it."""
    state = IncrementState("play", "alpha_rad", 0.0, 0.0, 0.01)
    play = behind(state, half_width=ParameterEstimate(0.01, 0.002, (None, None)))
    (own,) = BandQuestion((play,)).at(bench, campaign, 3, 0).learned
    width = own.effect.parameters[1]
    assert (width.low, width.high) == (pytest.approx(0.01 / 3.0), pytest.approx(0.03))
    np.testing.assert_allclose(own.sizes, [0.3, width.size(0.01)])


def test_an_increment_of_an_answer_is_the_one_that_was_learned(bench, campaign):
    (own,) = BandQuestion((accepted(),)).at(bench, campaign, 3, 0).learned
    assert own.effect.shape == replace(SHAPE, trim=own.effect.shape.trim)
    np.testing.assert_allclose(own.basis @ own.sizes, own.value, atol=1e-15)
    whole = accepted()
    before = replace(whole, parameters={k: v for k, v in whole.parameters.items() if k != "slope"})
    (same,) = BandQuestion((before,)).at(bench, campaign, 3, 0).learned  # of a version without slopes
    np.testing.assert_allclose(same.sizes, own.sizes, atol=1e-15)
    state = IncrementState("lag", "elevator_rad", 0.1)
    linear = behind(state, time_s=ParameterEstimate(0.1, 0.02, (None, None)))
    band = BandQuestion((linear,)).at(bench, campaign, 3, 0)
    (own,) = band.learned
    assert own.effect.shape.trim == pytest.approx(bench.plant.trims["elevator"])
    assert own.sizes == pytest.approx([0.3, 0.1])
    assert band.known == pytest.approx([0.1])


@pytest.mark.parametrize(
    ("names", "words"),
    [(("Cmw",), "Cmalpha"), ((), "--derivative Cmq,Cmde"), (("Cmq", "Cmq"), "state each once")],
)
def test_names_that_are_no_derivatives_are_refused(names, words):
    with pytest.raises(ConfigurationError, match=words):
        DerivativeQuestion(names)


def test_one_flight_has_one_aim():
    with pytest.raises(ConfigurationError, match="--split and --derivative exclude"):
        planned_from(None, Stated(("vane_lag", "gyro_lag"), {}, ("Cmq",)), "gtm", PlanOptions())
    with pytest.raises(ConfigurationError, match="--size applies to effects"):
        planned_from(None, Stated((), {"vane_lag.tau_s": 0.1}, ("Cmq",)), "gtm", PlanOptions())


def test_names_of_derivatives_are_completed():
    assert list(complete_derivative("Cm")) == ["Cmalpha", "Cmde", "Cmq"]
    assert list(complete_derivative("Cmq,CLa")) == ["Cmq,CLalpha"]
    assert list(complete_derivative("Cmq,Cmq")) == []


@pytest.fixture(scope="module")
def answer():
    read = TraceAnswer.read(SAMPLE)
    return replace(read, effects=read.effects[:1], alternatives=(), verdict="traced", provisional=False)


def candidate(name, why_not="its score is not significant"):
    return CandidateScore(name, 4.0, 0.5, True, why_not)


def test_a_learned_increment_asks_for_its_band(answer):
    asked = asked_by(replace(answer, verdict="learned", effects=(accepted(),)), "trace.json")
    assert isinstance(asked, BandQuestion)
    assert asked.title == "the input that narrows the band of Cm over alpha_rad"


def test_shifted_derivatives_ask_for_the_one_that_is_known_least(answer):
    """Cmq has 0.05 of its declared value as standard deviation, Cmalpha 0.1."""
    declared = {"Cmalpha": -2.0, "Cmq": -40.0}
    shifts = {
        "dCmalpha": ParameterEstimate(0.3, 0.2, (None, None)),
        "dCmq": ParameterEstimate(9.0, 2.0, (None, None)),
    }
    effect = AcceptedEffect("derivatives", shifts, 1e-9, 9.0)
    shifted = replace(answer, effects=(effect,), derivatives=replace(answer.derivatives, declared=declared))
    assert asked_by(shifted, "trace.json") == DerivativeQuestion(("Cmalpha",))


def test_a_cause_tied_with_wrong_declarations_asks_for_the_derivative_that_is_known_least(answer):
    """No input separates `derivatives`; the other ties of the cause still count."""
    size = {"factor": ParameterEstimate(0.8, 0.05, (0.7, 0.9))}
    cause = AcceptedEffect("tail_effectiveness", size, 1e-9, 1.0, indistinguishable_from=("derivatives",))
    known = replace(
        answer.derivatives,
        declared={"Cmalpha": -2.0, "Cmq": -40.0},
        after_std={"Cmalpha": 0.02, "Cmq": 2.0},
    )
    tied = replace(answer, verdict="one_of", effects=(cause,), candidates=(), derivatives=known)
    assert asked_by(tied, "trace.json") == DerivativeQuestion(("Cmq",))
    more = replace(cause, indistinguishable_from=("derivatives", "wing_effectiveness"))
    pair = asked_by(replace(tied, effects=(more,)), "trace.json")
    assert [h.effect.key for h in pair] == ["tail_effectiveness", "wing_effectiveness"]


def test_a_provisional_name_is_separated_from_its_nearest_rival(answer):
    effect = AcceptedEffect("gyro_lag", {"tau_s": ParameterEstimate(0.02, 0.002, (0.016, 0.024))}, 1e-9, 3.0)
    rivals = (
        candidate("gyro_lag", ""),
        candidate("gust_level"),
        candidate("derivatives"),
        candidate("vane_arm"),
    )
    alone = replace(answer, effects=(effect,), candidates=rivals, provisional=True)
    first, second = asked_by(alone, "trace.json")
    assert first.effect.key == "gyro_lag"
    assert first.sizes == pytest.approx([0.02])
    assert second.effect.key == "vane_arm"
    assert second.sizes is None
    with pytest.raises(ConfigurationError, match="--split gyro_lag,vane_arm to confirm"):
        asked_by(replace(alone, provisional=False), "trace.json")


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("none", "explains the records; state --split A,B for effects that you expect, or --derivative"),
        (
            "unexplained",
            "no hypothesis has a size to plan for; fly what `next_flight` of the trace states, or state ",
        ),
    ],
)
def test_a_verdict_without_effects_names_the_options(answer, verdict, words):
    with pytest.raises(ConfigurationError, match=words):
        asked_by(replace(answer, effects=(), verdict=verdict), "trace.json")


@pytest.fixture
def quick(monkeypatch):
    """A search of a few inputs."""
    monkeypatch.setattr(searching, "_CHILDREN", 8)
    monkeypatch.setattr(searching, "_UNITS", 2)


@pytest.mark.long
@pytest.mark.slow
def test_command_line_writes_a_campaign_that_flies(quick, tmp_path):
    out = tmp_path / "next.toml"
    line = ["plan", "--derivative", "Cmq,Cmde", "--aircraft", "gtm", "--out", str(out), "--json", "--quiet"]
    line += ["--length-s", "3", "--alpha-deg", "2", "--rate-deg-s", "60", "--records", "4"]
    run = CliRunner().invoke(cli.app, line)
    assert run.exit_code == 0, run.output
    facts = json.loads(run.stdout)
    for name in ("Cmq", "Cmde"):
        assert 0.0 < facts["expected_std"][name] < facts["known_std"][name]
    gains = [facts["reference_std"][n] / facts["expected_std"][n] for n in ("Cmq", "Cmde")]
    assert max(gains) >= 1.0
    assert facts["inputs"][0]["merit"] >= facts["inputs"][-1]["merit"]
    assert facts["reached"]["alpha_rad"] <= 2.0 * DEG * (1.0 + 1e-9)
    assert facts["reached"]["rate_rad_s"] <= 60.0 * DEG * (1.0 + 1e-9)
    assert make(out).campaign.runs == 4
    assert out.with_suffix(".png").stat().st_size > 10_000
    assert not at.fly(out, tmp_path / "flown", runs=1).failures
    again = CliRunner().invoke(cli.app, line)
    assert json.loads(again.stdout) == facts
    declared = forecast(out)  # without draws of the derivatives
    index = LONGITUDINAL.parameters.index("Cmq")
    assert facts["expected_std"]["Cmq"] == pytest.approx(declared.together[index], rel=0.1)


@pytest.mark.slow
def test_a_trace_with_an_increment_plans_its_band(quick, answer, gtm, campaign, tmp_path):
    learned = replace(answer, verdict="learned", effects=(accepted(),))
    (tmp_path / "trace.json").write_text(learned.to_json())
    result = at.plan(campaign, trace=tmp_path, limits=LIMITS, records=3, out=tmp_path / "next.toml")
    assert isinstance(result, Result)
    assert result.ratio >= 1.0
    assert all(q.expected < q.known for q in result.quantities)
    frame = result.to_frame()
    assert frame["merit"].max() == result.best.merit
    assert [row[0] for row in result.table().rows] == frame["family"].tolist()
    assert "Cm over alpha_rad = 0.065" in result.summary()
    assert result._repr_html_().count("<table") == 2
    figure = result.plot()
    assert len(figure.axes) == 3
    assert len(figure.legends) == 1
    assert not any(ax.get_legend() for ax in figure.axes), "a legend hides a curve"
    assert make(tmp_path / "next.toml").campaign.runs == 3


@pytest.mark.slow
def test_estimates_of_a_repeated_input_spread_as_expected():
    """Filter error on 200 linear records in light gusts.

    The spread of 200 estimates is known within 5 % (a standard deviation); three of them, and an efficiency of 78 to 100 %
    (docs/filter_error.md), allow ratios of 0.85 to 1.30.
    """
    made = multistep(repeated("3-2-1-1", 2), 0.265, 0.0, 0.005)
    record = {"amplitude_rad": 2.0 * DEG, "duration_s": 6.0, "shape": lambda t_s: sample(made, t_s)}
    noise = dict(zip(("alpha_rad", "q_rad_s", "az_m_s2"), NOISE[:3], strict=True))
    experiment = LinearExperiment(GTM, noise, GustScales(*LIGHT), AIRSPEED_M_S, 0.02, "rest")
    still = {name: values[0] for name, values in fly(**record).channels.items()}
    expected = np.sqrt(np.diag(experiment.least_covariance(still, THETA)))
    error = experiment.linear_error(
        still, THETA
    )  # a linear aircraft has none but that of the surface between samples
    assert (np.abs(error) < 0.15 * expected).all(), error / expected
    batch = fly(runs=200, gust=1.0, noise=1.0, seed=5, **record)
    options = FilterOptions(*NOISE[:3], *LIGHT, airspeed_m_s=AIRSPEED_M_S)
    found = filter_error(batch, GTM, np.tile(THETA, (200, 1)), options).theta
    ratio = found.std(axis=0) / expected
    assert ((ratio > 0.85) & (ratio < 1.30)).all(), ratio
