"""Learning of increments: the evidence, the prior on sizes, and the way from flights to a learned aircraft."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trace_flights as flights
import trace_records as tr
from pydantic import TypeAdapter
from scipy.stats import multivariate_normal

from airtruth import aircraft as planes
from airtruth import report
from airtruth.aircraft import write as writing
from airtruth.effects.increment import Memory, Shape, increment
from airtruth.errors import ConfigurationError
from airtruth.physics.terms import AeroTerm, Change, ReadingTerm, shape_of, term_value
from airtruth.table import significant
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.accepted import AcceptedEffect, IncrementState, IncrementTable, ParameterEstimate
from airtruth.tracing.anomalies.flown import flown
from airtruth.tracing.effect_module import MODULE, effect_module
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import (
    likelihood_terms,
    marginal_information,
    prior_cost,
    sensitivities_of,
)
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.learning.increment_fit import (
    effective_bends,
    is_apart_from_zero,
)
from airtruth.tracing.learning.increments import (
    log_evidences,
    posterior_bends,
    screen,
    shapes,
    sharpened,
)
from airtruth.tracing.model.compile import compile_change
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.presentation.text import increment_words
from airtruth.tracing.update import from_zero_alpha
from airtruth.units import DEG


def test_evidence_is_that_of_a_linear_model():
    """y = X b + e: the log of the ratio of the marginal densities, computed from the densities themselves."""
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(40, 3)), rng.normal(size=40)
    stds = np.array([0.1, 0.7, 3.0])
    expected = [
        multivariate_normal(np.zeros(40), np.eye(40) + s**2 * x @ x.T).logpdf(y)
        - multivariate_normal(np.zeros(40), np.eye(40)).logpdf(y)
        for s in stds
    ]
    np.testing.assert_allclose(log_evidences(-x.T @ y, x.T @ x, stds), expected, rtol=1e-9)


def test_bends_are_those_of_a_linear_model():
    """Ridge regression, solved by the rows of the prior appended to those of the data."""
    rng = np.random.default_rng(4)
    x, y, std = rng.normal(size=(40, 3)), rng.normal(size=40), 0.3
    expected, *_ = np.linalg.lstsq(np.vstack([x, np.eye(3) / std]), np.append(y, np.zeros(3)), rcond=None)
    bends, covariance = posterior_bends(-x.T @ y, x.T @ x, std)
    np.testing.assert_allclose(bends, expected, rtol=1e-10)
    np.testing.assert_allclose(covariance @ (x.T @ x + np.eye(3) / std**2), np.eye(3), atol=1e-10)


def test_bends_of_an_information_that_is_rounding_are_finite():
    """Two directions that differ by rounding: the smaller eigenvalue may be negative and equal to less the prior's precision."""
    std = 0.1
    information = np.diag([1e20, -1.0 / std**2])
    bends, _ = posterior_bends(np.array([1e10, 1.0]), information, std)
    np.testing.assert_allclose(bends, [-1e-10, -(std**2)], rtol=1e-12)


def test_the_prior_of_a_size_enters_cost_gradient_and_information():
    shape = Shape("Cm", "alpha", 0.02, 0.12, 4, trim=0.06)
    free, held = (Hypothesis(Change(), (increment(shape, std),)) for std in (np.inf, 0.02))
    problem = tr.problem([tr.fly(np.random.default_rng(1), samples=120)])
    point = replace(tr.point(problem.records, [0.0]), sizes=np.array([0.01, -0.02, 0.03, 0.01]))
    assert prior_cost(problem.priors(held), point) - prior_cost(problem.priors(free), point) == pytest.approx(
        0.5 * (0.01**2 + 0.02**2 + 0.03**2 + 0.01**2) / 0.02**2
    )
    terms = [likelihood_terms(sensitivities_of(problem, 0, held, point), NO_WHITENER, levels=True)]
    with_prior, without = (
        marginal_information(problem.priors(h), point, terms, levels=True) for h in (held, free)
    )
    sizes = [(SHORT_PERIOD.common.size + k) for k in range(4)]
    np.testing.assert_allclose(
        (with_prior.information - without.information)[np.ix_(sizes, sizes)], np.eye(4) / 0.02**2, rtol=1e-6
    )
    np.testing.assert_allclose(
        (with_prior.gradient - without.gradient)[sizes], point.sizes / 0.02**2, rtol=1e-6
    )


def an_effect(value, acts_on="Cm"):
    at = np.linspace(0.0, 0.2, 9).tolist()
    half = [0.0 if v == 0.0 else 1e-3 for v in value]
    table = IncrementTable(
        tuple(at),
        tuple(value),
        tuple(v - h for v, h in zip(value, half, strict=True)),
        tuple(v + h for v, h in zip(value, half, strict=True)),
        (20,) * 9,
    )
    return AcceptedEffect(
        "increment",
        {},
        0.0,
        1.0,
        variant=f"{acts_on} over alpha_rad",
        acts_on=acts_on,
        over="alpha_rad",
        table=table,
    )


class Answer:
    verdict = "learned"

    def __init__(self, *effects):
        self.effects = effects


def executed(text):
    space: dict[str, object] = {}
    exec(compile(text, f"{MODULE}.py", "exec"), space)
    return space["EFFECTS"]


def test_the_written_module_holds_the_closed_form():
    value = [0.0, 0.0, 0.0, 0.0, 0.0, -0.01, -0.02, -0.03, -0.04]
    (effect,) = executed(effect_module(Answer(an_effect(value))))
    assert [p.name for p in effect.parameters] == ["slope", "at"]
    assert effect.change({"slope": -0.4, "at": 0.1}).aero[0].shape == "above"
    assert "Learned from 0 to 0.2 rad; it extrapolates outside this range." in effect.source


def test_the_written_module_of_a_derivative_that_changes_linearly_is_a_line():
    """The table is Cmde = 5 (alpha - 0.09), the trim between two points."""
    own = an_effect((5.0 * (np.linspace(0.0, 0.2, 9) - 0.09)).tolist())
    pair = replace(own, table=replace(own.table, trim=0.09), by="elevator_rad", by_at=0.01)
    (effect,) = executed(effect_module(Answer(pair)))
    (term,) = effect.change({"slope": 5.0}).aero
    assert [p.name for p in effect.parameters] == ["slope"]
    assert (term.shape, term.signal, term.amplitude, term.at) == ("linear", "alpha", 5.0, 0.09)
    assert (term.factor, term.factor_at) == ("elevator", 0.01)


def behind_a_lag(acts_on, time_s):
    value = [0.0, 0.0, 0.0, 0.0, 0.0, -0.01, -0.02, -0.03, -0.04]
    state = IncrementState("lag", "alpha_rad", time_s)
    return replace(an_effect(value, acts_on), variant=f"{acts_on} over a lag of alpha_rad", states=(state,))


def test_two_written_effects_with_memory_have_states_of_their_own():
    moment, lift = executed(effect_module(Answer(behind_a_lag("Cm", 0.08), behind_a_lag("CL", 0.04))))
    change = moment.change({"slope": -0.4, "at": 0.1}) + lift.change({"slope": 0.4, "at": 0.1})
    compiled = compile_change(change)
    np.testing.assert_array_equal(compiled.effects.time_s, [0.08, 0.04])
    # the term of CL follows the second state
    np.testing.assert_array_equal(compiled.effects.term_index[:, 3], compiled.effect_states)
    with pytest.raises(ConfigurationError, match="two states are named 'learned-Cm-alpha-lag'"):
        compile_change(moment.change({"slope": -0.4, "at": 0.1}) + moment.change({"slope": 0.1, "at": 0.1}))


def test_the_filter_leaves_out_terms_without_a_size():
    flat, bent = (AeroTerm("Cm", "alpha", "above", slope, 0.1) for slope in (0.0, -0.4))
    reading = ReadingTerm("q_rad_s", "alpha", "linear", 0.0)
    assert compile_change(Change(aero=(flat, bent), readings=(reading,))).effects.amplitude.tolist() == [-0.4]


@pytest.mark.parametrize("trim", [0.05, 0.06, 0.075])
def test_the_written_module_scales_a_table_without_a_closed_form(trim):
    """The trim at either end of the flat cell, and in it."""
    value = [0.004, -0.003, 0.0, 0.0, 0.005, -0.012, 0.014, -0.015, 0.018]
    learned = an_effect(value)
    (effect,) = executed(effect_module(Answer(replace(learned, table=replace(learned.table, trim=trim)))))
    change = effect.change({"factor": 2.0})
    at = np.linspace(0.0, 0.2, 9)
    flown = sum(t.amplitude * shape_of(t, at) for t in change.aero)
    np.testing.assert_allclose(flown, 2.0 * np.array(value), atol=1e-12)


@pytest.mark.parametrize("trim", [0.0, 0.0625, 0.2])
def test_the_written_module_of_a_table_with_a_slope_at_the_trim_is_that_table(trim):
    """The trim is an end of the table, or halves the cell from 0.05 to 0.075; the slope there is that of the cell."""
    value = np.array([0.004, 0.006, 0.001, -0.001, 0.005, -0.012, 0.014, -0.015, 0.018])
    value -= np.interp(trim, np.linspace(0.0, 0.2, 9), value)
    learned = an_effect(value.tolist())
    (effect,) = executed(effect_module(Answer(replace(learned, table=replace(learned.table, trim=trim)))))
    change = effect.change({"factor": 1.0})
    at = np.linspace(-0.02, 0.22, 49)
    flown = sum(t.amplitude * shape_of(t, at) for t in change.aero)
    np.testing.assert_allclose(flown, np.interp(at, np.linspace(0.0, 0.2, 9), value), atol=1e-12)


def test_the_width_of_a_written_step_is_within_its_range():
    """A step of -0.03 at 0.13 within less than a cell of 24: the width is not determined, and its default is allowed."""
    at = np.linspace(0.0, 0.2, 25)
    value = -0.03 * (at > 0.13)
    table = IncrementTable(
        tuple(at.tolist()),
        tuple(value.tolist()),
        tuple((value - 1e-4).tolist()),
        tuple((value + 1e-4).tolist()),
        (20,) * 25,
        0.05,
    )
    (effect,) = executed(effect_module(Answer(replace(an_effect([0.0] * 9), table=table))))
    width = next(p for p in effect.parameters if p.name == "width")
    assert width.low <= width.default <= width.high


@pytest.mark.parametrize(
    ("changes", "slope", "location"),
    [
        ({}, "1/rad", "rad"),
        ({"over": "qbar_pa"}, "1/Pa", "Pa"),
        ({"over": "q_hat"}, "-", "-"),
        ({"acts_on": "az_m_s2"}, "m/s2/rad", "rad"),
        ({"by": "elevator_rad"}, "1/rad/rad", "rad"),
    ],
)
def test_the_written_module_states_the_units_of_its_parameters(changes, slope, location):
    at = np.linspace(0.0, 0.2, 9)
    learned = replace(an_effect((-0.4 * np.maximum(at - 0.1, 0.0)).tolist()), **changes)
    (effect,) = executed(effect_module(Answer(learned)))
    meanings = {p.name: p.meaning for p in effect.parameters}
    assert meanings["slope"] == f"slope [{slope}], learned: -0.4"
    assert meanings["at"] == f"value of the signal where it begins [{location}], learned: 0.1"


def test_a_form_of_a_pair_adds_no_derivative_at_the_trim():
    """A break at 0.05 below the trim 0.1 is not recovered: it would be -0.02 at the trim, where the derivative is declared."""
    at = np.linspace(0.0, 0.2, 9)
    value = -0.4 * (np.maximum(at - 0.05, 0.0) - 0.05)
    whole = an_effect(value.tolist())
    moved = replace(whole, table=replace(whole.table, trim=0.1), by="elevator_rad", by_at=0.0)
    (pair,) = executed(effect_module(Answer(moved)))
    (alone,) = executed(effect_module(Answer(replace(moved, by=None))))
    assert [p.name for p in alone.parameters] == ["slope", "at"]
    assert [p.name for p in pair.parameters] == ["factor"]


def test_terms_over_alpha_and_over_what_it_drives_count_from_zero():
    """A linear part behind a lag of alpha, counted from the trim 0.05, vanishes at rest in an aircraft too."""
    shape = Shape("CL", "alpha", -0.1, 0.1, 0, trim=0.0, memory=Memory("lag", 0.3))
    change = from_zero_alpha(increment(shape).change({"share": 0.8, "time_s": 0.3}), 0.05)
    assert [(t.amplitude, t.at) for t in change.aero] == [(0.8, 0.05), (-0.8, 0.05)]
    pair = AeroTerm("Cm", "elevator", "linear", 1.0, 0.02, "alpha", 0.01)
    (moved,) = from_zero_alpha(Change(aero=(pair,)), 0.05).aero
    assert (moved.at, moved.factor_at) == (0.02, pytest.approx(0.06))


def test_the_written_module_of_a_reading_changes_the_sensor():
    value = [0.0, 0.0, 0.0, 0.0, 0.0, -0.01, -0.02, -0.03, -0.04]
    (effect,) = executed(effect_module(Answer(an_effect(value, "alpha_rad"))))
    (term,) = effect.change({"slope": -0.4, "at": 0.1}).readings
    assert effect.where == "sensor"
    assert (term.channel, term.signal, term.shape, term.amplitude) == ("alpha_rad", "alpha", "above", -0.4)


def test_hysteresis_has_its_module_its_words_and_its_file():
    state = IncrementState("play", "alpha_rad", 0.0, half_width=0.02)
    share = {"share": ParameterEstimate(-0.6, 0.01, (-0.62, -0.58))}
    effect = AcceptedEffect(
        "increment",
        share,
        0.0,
        1.0,
        variant="Cm over a play of alpha_rad",
        acts_on="Cm",
        over="alpha_rad",
        states=(state,),
    )
    (written,) = executed(effect_module(Answer(effect)))
    (play,) = written.change({"share": -0.6}).states
    assert (play.kind, play.signal, play.half_width) == ("play", "alpha", 0.02)
    assert "through a play of half width 0.020" in increment_words(effect)
    stored = TypeAdapter(AcceptedEffect)
    assert stored.validate_json(json.dumps(effect.to_dict())) == effect


@pytest.mark.parametrize(
    ("value", "shape", "amplitude", "at", "width"),
    [
        ([0.0] * 5 + [-0.02] * 4, "above", -0.8, 0.1, 0.025),
        ([0.02] * 2 + [0.0] * 7, "below", -0.8, 0.05, 0.025),
    ],
)
def test_the_written_module_of_a_step_behind_a_play_has_its_cell(value, shape, amplitude, at, width):
    """The trim is 0.06 rad. The table does not tell where within the zeros a step begins; the increment does."""
    own = an_effect(value)
    step = replace(
        own,
        parameters={"step": ParameterEstimate(-0.02, 0.001, (-0.022, -0.018))},
        states=(IncrementState("play", "alpha_rad", 0.0, half_width=0.01),),
        table=replace(own.table, trim=0.06),
    )
    (effect,) = executed(effect_module(Answer(step)))
    values = {p.name: p.default for p in effect.parameters}
    assert (values["at"], values["width"]) == pytest.approx((at, width))
    first = effect.change(values | {"step": 0.02 if shape == "below" else -0.02}).aero[0]
    assert (first.shape, first.amplitude, first.at) == (shape, pytest.approx(amplitude), pytest.approx(at))
    middle = at + (0.5 if shape == "above" else -0.5) * width
    comes, goes = significant(middle + 0.01), significant(middle - 0.01)
    sentence = (
        f"a step of -0.020 (95 %: -0.0220 to -0.0180) that comes where alpha_rad rises above {comes} and goes"
    )
    assert f"{sentence} where it falls below {goes}" in increment_words(step)


def of_a_derivative(value):
    """The same of the derivative Cmde, from an elevator of 0.01 rad on."""
    return replace(
        an_effect(value), by="elevator_rad", by_at=0.01, variant="Cm by elevator_rad over alpha_rad"
    )


@pytest.mark.parametrize(
    "value", [[0.0] * 5 + [-0.1, -0.2, -0.3, -0.4], [0.4, -0.3, 0, 0, 0.5, -1.2, 1.4, -1.5, 1.8]]
)
def test_the_written_module_of_a_derivative_has_its_factor(value):
    (effect,) = executed(effect_module(Answer(of_a_derivative(value))))
    assert effect.name == "learned_cm_elevator_alpha"
    change = effect.change(
        {p.name: {"slope": -4.0, "at": 0.1, "factor": 1.0}[p.name] for p in effect.parameters}
    )
    assert {(t.factor, t.factor_at) for t in change.aero} == {("elevator", 0.01)}
    at = np.linspace(0.0, 0.2, 9)
    flown = sum(term_value(t, {"alpha": at, "elevator": np.full(9, 0.03)}) for t in change.aero)
    np.testing.assert_allclose(flown, 0.02 * np.array(value), atol=1e-12)


def test_a_learned_derivative_survives_its_file_and_is_named_in_words():
    effect = of_a_derivative([0.0] * 5 + [-0.1, -0.2, -0.3, -0.4])
    plain = an_effect([0.0] * 9)
    stored = TypeAdapter(AcceptedEffect)  # as `TraceAnswer.from_dict` reads the effects of trace.json
    assert stored.validate_json(json.dumps(effect.to_dict())) == effect
    assert stored.validate_json(json.dumps(plain.to_dict())) == plain
    assert (effect.to_dict()["by"], effect.to_dict()["by_at"]) == ("elevator_rad", 0.01)
    assert plain.by is None
    assert increment_words(effect).startswith("Cm by elevator_rad -0.40 at alpha_rad = 0.200")


CHANGING_LAG = "alpha_rad by a lag of alpha_rad over qbar_pa"


def test_a_lag_that_changes_with_the_dynamic_pressure_has_its_module_and_its_words():
    """Its table is the change of the time constant over the time constant of the state."""
    table = replace(
        an_effect([0.0] * 5 + [-0.1, -0.2, -0.3, -0.4]).table,
        at=tuple(np.linspace(900.0, 1100.0, 9).tolist()),
    )
    effect = AcceptedEffect(
        "increment",
        {},
        0.0,
        1.0,
        variant=CHANGING_LAG,
        acts_on="alpha_rad",
        over="qbar_pa",
        by="alpha_rad",
        table=table,
        states=(IncrementState("lag", "alpha_rad", 0.1, 0.0),),
    )
    words = increment_words(effect)
    assert words.startswith("alpha_rad by a lag of alpha_rad -0.40 at qbar_pa = 1100")
    assert "the time constant changes by -0.040 s there" in words
    (learned,) = executed(effect_module(Answer(effect)))
    assert learned.name == "learned_alpha_rad_alpha_qbar"
    change = learned.change({p.name: {"slope": -4e-3, "at": 1000.0}[p.name] for p in learned.parameters})
    (state,), (term,) = change.states, change.readings
    assert (state.signal, state.time_s) == ("alpha", 0.1)
    assert (term.channel, term.signal, term.behind) == ("alpha_rad", "qbar", state.name)


def test_pairs_and_the_dynamic_pressure_are_tried_where_the_airspeed_varies():
    names = {v: {s.variant for s in shapes(tr.problem([varying(v)]))} for v in (0.0, 0.05)}
    pairs = {
        "CL by elevator_rad over alpha_rad",
        "CL by q_hat over alpha_rad",
        "Cm by elevator_rad over alpha_rad",
        "Cm by q_hat over alpha_rad",
    }
    pressure = {
        f"{c}{by} over qbar_pa"
        for c in ("CL", "Cm")
        for by in ("", " by alpha_rad", " by elevator_rad", " by q_hat")
    }
    assert pairs <= names[0.0]
    assert names[0.05] - names[0.0] == pressure | {CHANGING_LAG}


@pytest.mark.parametrize("signal", ["alpha", "elevator", "qhat", "alpha_dot_hat", "qbar"])
def test_each_signal_has_one_value_for_each_sample(signal):
    one = varying(0.05)
    assert flown(one, signal).shape == (one.samples,)


def varying(share):
    """A record whose airspeed rises by a share."""
    one = tr.fly(np.random.default_rng(1))
    speed = one.signals.airspeed_m_s
    rising = speed * np.linspace(1.0, 1.0 + share, speed.size)
    return replace(one, signals=replace(one.signals, airspeed_m_s=rising))


@pytest.mark.slow
def test_a_step_behind_a_play_is_sharpened_to_its_location_and_half_width():
    """A reading of the vane that jumps by 0.3 deg where a play of 0.4 deg passes 0.9 deg, to within half a cell of the grid."""
    low, high, half, at = -3.0 * DEG, 3.0 * DEG, 0.4 * DEG, 0.9 * DEG

    def jumping(one):
        y, play = one.signals.y.copy(), 0.0
        for k, alpha in enumerate(one.signals.y[:, 0]):
            play = min(max(play, alpha - half), alpha + half)
            y[k, 0] = alpha + 0.3 * DEG * (play > at)
        return replace(one, signals=replace(one.signals, y=y))

    quiet = 0.1 * tr.SETTINGS.noise
    rng = np.random.default_rng(5)
    problem = tr.problem([jumping(tr.fly(rng, sigma_w=0.0, amplitude=a * DEG, noise=quiet)) for a in (3, -3)])
    null = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
    tried = [
        Shape("alpha_rad", "alpha", low, high, 12, 0.0, Memory("play", half_width=h), step_cell=k)
        for h in (0.2 * DEG, 0.45 * DEG)
        for k in range(12)
    ]
    best = screen(problem, null, NO_WHITENER, tried)[0]
    sharp = sharpened(problem, null, NO_WHITENER, [best])[0]
    shape = sharp.effect.shape
    assert sharp.log_evidence > best.log_evidence
    assert shape.low + (shape.step_cell + 0.5) * shape.width == pytest.approx(at, abs=0.25 * DEG)
    assert shape.memory.half_width == pytest.approx(half, abs=0.1 * DEG)


def test_bends_that_the_prior_holds_do_not_count():
    """Ten bends, of which two have a tenth of their prior's standard deviation and eight all of it: gamma of a diagonal."""
    variance = np.array([0.01] * 2 + [1.0] * 8)
    assert effective_bends(0.25 * np.diag(variance), 0.5) == pytest.approx(2.0 * 0.99)
    bends = 0.5 * np.sqrt(variance) * np.array([2.6, 2.6] + [0.0] * 8)
    # chi-square of 13.5: significant on 2 degrees of freedom, not on 10 (probability 0.0011 and 0.20)
    assert is_apart_from_zero(bends, 0.25 * np.diag(variance), 1.98)
    assert not is_apart_from_zero(bends, 0.25 * np.diag(variance), 10.0)


NEEDED = increment(Shape("Cm", "elevator", -3.0 * DEG, 3.0 * DEG, 6, trim=0.0), 0.01)
"""What a surface lacks that is measured half a degree too far for each degree beyond one."""
IDLE = increment(Shape("Cm", "alpha", -0.03, 0.03, 4, trim=0.0), 0.01)


def beyond_one_degree(one):
    e = one.signals.elevator_rad
    measured = e + 0.5 * np.sign(e) * np.maximum(np.abs(e) - DEG, 0.0)
    return replace(one, signals=replace(one.signals, controls_rad=measured[None]))


OTHERS = ("elevator_delay", "vane_lag", "gyro_lag")


@pytest.mark.long
def test_a_break_that_the_library_lacks_is_learned_added_and_confirmed(tmp_path):
    """The library is left without breaks and curves (three effects of sensors and surface); Cm has a break at 5 deg."""
    truth = {"dCmalpha": -1.2, "at_alpha_rad": np.deg2rad(5.0)}
    place = flights.fly(tmp_path, [("cm_alpha_nonlinear:break", truth)], runs=6, seed=77, amplitude=3.0)
    options = TraceOptions(effects=OTHERS, increments=True)
    result = trace(place, "gtm", options, tmp_path / "out")
    answer = json.loads((tmp_path / "out" / "trace.json").read_text())
    assert answer["verdict"] == "learned"
    assert answer["confirmed"]
    increments = {e["variant"]: e for e in answer["effects"] if e["name"] == "increment"}
    assert list(increments) == ["Cm over alpha_rad"]
    effect = increments["Cm over alpha_rad"]
    assert (effect["acts_on"], effect["over"], effect["states"]) == ("Cm", "alpha_rad", [])
    table = effect["table"]
    assert len(table["at"]) == len(table["value"]) == len(table["samples"]) in (9, 13, 17, 25, 37)
    assert not answer["provisional"]
    assert all(
        low <= v <= high for low, v, high in zip(table["low"], table["value"], table["high"], strict=True)
    )
    held = {s: answer["error"][s]["held_out"]["free_run"]["q_rad_s"] for s in ("before", "after", "floor")}
    assert held["after"] < held["before"]
    page = report(tmp_path / "out", tmp_path / "report.html")[0].read_text()
    assert "increment" in page
    assert executed(effect_module(result.answer))
    assert "tableData" in next((tmp_path / "out" / "aircraft").rglob("*.xml")).read_text()


@pytest.mark.long
def test_a_derivative_that_depends_on_the_angle_of_attack_is_learned(tmp_path):
    """Cmde loses 8/rad above 4 deg: from its value at the trim, in the cells beside it, up to the largest alpha."""
    term = AeroTerm("Cm", "alpha", "above", 8.0, 4.0 * DEG, "elevator", 0.02)
    writing.changed(planes.load("gtm"), Change(aero=(term,)), tmp_path / "gtm")
    place = flights.fly(tmp_path, runs=6, seed=3, amplitude=3.0, aircraft=str(tmp_path / "gtm"))
    answer = trace(place, "gtm", TraceOptions(effects=OTHERS, increments=True), tmp_path / "out").answer
    (effect,) = answer.effects
    assert (effect.acts_on, effect.by, effect.over) == ("Cm", "elevator_rad", "alpha_rad")
    table = effect.table
    expected = 8.0 * (np.maximum(np.array(table.at), 4.0 * DEG) - table.trim)
    # the derivative takes up a constant, and the table is zero in the cells of the trim: 0.1 rad^-1 there, of 0.75
    error = np.array(table.value) - expected
    assert np.sqrt(np.average(error**2, weights=table.samples)) < 0.1
    assert answer.updated_aircraft is not None
