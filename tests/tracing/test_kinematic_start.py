"""The kinematic check gives a trace its starting points, and contradictions between the two are stated."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from airtruth.checks.result import Finding
from airtruth.effects.registry import EFFECTS
from airtruth.logs.store import iter_logs
from airtruth.quantity import Quantity
from airtruth.simulation.campaign import run as campaign
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.accepted import AcceptedEffect, ParameterEstimate
from airtruth.tracing.kinematic_start import (
    disagreement,
    kinematic_check,
    likelihood_of,
    starts_of,
    with_contradictions,
    within_kinematics,
)

LAG_S = 0.2
CAMPAIGN = """
schema = 1
name = "slow"
aircraft = "gtm"
runs = 3
seed = 5
duration_s = 12.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "3211"
amplitude_deg = 2.0
start_s = 1.0
step_s = 0.4
[gust]
figures = "gtm"
level = "light"
factor = 0.3
[sensors.channel.alpha_rad]
lag = { value = 0.2, unit = "s" }
"""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slow")
    (folder / "slow.toml").write_text(CAMPAIGN)
    campaign.fly(folder / "slow.toml", folder / "out")
    return list(iter_logs(folder / "out"))


@pytest.mark.slow
def test_a_check_shows_a_slow_vane(logs, gtm):
    check = kinematic_check(logs, gtm, held=())
    (lag,) = (f.value for f in check.findings if f.name == "vane_lag")
    assert lag == pytest.approx(LAG_S, abs=0.02)
    assert len(check.run_ids) == 3


@pytest.mark.slow
def test_held_out_records_take_no_part(logs, gtm):
    last = logs[-1].run_ids[-1]
    assert last not in kinematic_check(logs, gtm, held={last}).run_ids


@pytest.mark.slow
def test_the_likelihood_of_the_kinematics_is_that_of_the_check(logs, gtm):
    """Its value at the check's own sets is the difference of their statistics, and its slope that of its value."""
    check = kinematic_check(logs, gtm, held=())
    told = likelihood_of(check)
    none = next(e.fit for e in check.search.tried if not e.fit.names)
    for one in check.search.tried[:6]:
        if set(one.fit.names) <= told.names:
            effects = [EFFECTS[name] for name in one.fit.names]
            sizes = np.array([e.parameters[0].size(v) for e, v in zip(effects, one.fit.value, strict=True)])
            expected = 0.5 * (one.fit.statistic - none.statistic) / check.search.enlargement
            assert told.terms(effects, sizes).value == pytest.approx(expected, rel=1e-9)
    effects = [EFFECTS["vane_lag"], EFFECTS["elevator_delay"], EFFECTS["gyro_scale"]]
    at, step = np.array([0.15, 0.02, 0.01]), 1e-6
    terms = told.terms(effects, at)
    for k in (0, 2):
        moved = [told.terms(effects, at + sign * step * np.eye(3)[k]).value for sign in (-1.0, 1.0)]
        assert terms.slope[k] == pytest.approx((moved[1] - moved[0]) / (2.0 * step), rel=0.02)
    # Gauss-Newton: the outer product of the derivatives is symmetric, and a delay of the elevator is no error of a sensor
    assert terms.slope[1] == 0.0
    assert not terms.information[1].any()
    assert terms.information == pytest.approx(terms.information.T)


@pytest.mark.slow
def test_a_size_multiplies_a_declared_factor(logs, gtm):
    """The vane is declared with a scale of 1.1: a size of -0.1 is an error of 0.99."""
    file = gtm.file
    vane = file.sensors["alpha_rad"].model_copy(update={"scale": Quantity(value=1.1)})
    declared = gtm.model_copy(
        update={"file": file.model_copy(update={"sensors": file.sensors | {"alpha_rad": vane}})}
    )
    told = likelihood_of(kinematic_check(logs, declared, held=()))
    problem, size = told.search.problem, np.array([-0.1])
    others = {
        n: v
        for n, v in zip(told.search.best.fit.names, told.search.best.fit.value, strict=True)
        if n not in told.names
    }
    at, none = (problem.moments({**others, **more}) for more in ({"vane_scale": 0.99}, {}))
    expected = 0.5 * (at @ at - none @ none) / told.search.enlargement
    assert told.terms([EFFECTS["vane_scale"]], size).value == pytest.approx(expected, rel=1e-9)


def test_a_check_that_failed_tells_nothing():
    check = airspeed_check("present")
    check.search, check.verdict = object(), "failed"
    assert likelihood_of(check) is likelihood_of(None) is None


@pytest.mark.long
def test_a_trace_refits_the_cause_and_agrees(logs, gtm):
    steps = []
    result = trace(
        logs, gtm, TraceOptions(model="linear", effects=("vane_lag", "elevator_delay")), advance=steps.append
    )
    # a leading refit that ends at the size of the check is not repeated from there
    assert "refit vane_lag" in steps
    (effect,) = result.answer.effects
    assert effect.name == "vane_lag"
    assert effect.parameters["tau_s"].value == pytest.approx(LAG_S, abs=0.02)
    assert not any("kinematic check" in note for note in result.answer.notes)
    # without the effect, and with another size, the same answer contradicts the check
    check = kinematic_check(logs, gtm, held=())
    (note,) = disagreement(check, replace(result.answer, effects=()), 0.02)
    assert "names" in note
    assert "vane_lag" in note
    other = replace(effect.parameters["tau_s"], value=0.5, ci95=(0.45, 0.55))
    (note,) = disagreement(
        check, replace(result.answer, effects=(replace(effect, parameters={"tau_s": other}),)), 0.02
    )
    assert "vane_lag: the trace estimates 0.5" in note


def test_a_bias_of_the_check_is_compared_with_that_of_the_trace():
    """A gyro bias of 0.02 to 0.04 rad/s by kinematics beyond a declared 0.01, and -0.05 by the trace."""
    found = Finding("gyro_bias", "rad/s", "", 0.04, 0.005, 0.03, 0.05, 0.01, 0.001, "shown")
    check = SimpleNamespace(verdict="errors", possible=(), findings=(found,))
    own = ParameterEstimate(-0.05, 0.01, (-0.07, -0.03))
    effect = AcceptedEffect("gyro_bias", {"value": own}, 1e-9, 5.0)
    (note,) = disagreement(check, SimpleNamespace(effects=(effect,)), 0.02)
    assert note == "gyro_bias: the trace estimates -0.05, the kinematic check 0.02 to 0.04"
    answer = with_contradictions(Answer((effect,)), check, 0.02)
    assert (answer.provisional, answer.notes) == (True, (note,))
    agrees = replace(effect, parameters={"value": replace(own, ci95=(-0.07, 0.025))})
    assert with_contradictions(Answer((agrees,)), check, 0.02) == Answer((agrees,))


def airspeed_check(state):
    """A check whose equation of airspeed has a slope of -0.5 with a standard error of 0.02 [1/rad]."""
    found = Finding("airspeed_alpha_slope", "1/rad", "", -0.5, 0.02, -0.54, -0.46, 0.0, 0.07, state)
    return SimpleNamespace(
        verdict="errors", possible=(SimpleNamespace(errors=()),), findings=(found,), p_value=0.4
    )


def error(name, value=1.0, unit="m"):
    return SimpleNamespace(name=name, value=value, declared=0.0, unit=unit)


def test_alternatives_of_a_check_are_sets_and_its_airspeed_belongs_to_each():
    """Errors that the library lacks take no part: a lag of the attitude alone needs no effect."""
    check = airspeed_check("not needed")
    one, other, attitude = map(error, ("vane_arm", "accelerometer_arm", "attitude_lag"))
    check.possible = tuple(
        SimpleNamespace(errors=errors) for errors in ((one,), (other, attitude), (attitude,))
    )
    airspeed = check.findings
    check.findings = (
        *airspeed,
        *(Finding(e.name, "m", "", 1.0, 0.1, 0.8, 1.2, 0.0, 0.2, "present") for e in (one, other)),
    )
    assert starts_of(check, 0.02) == ({"vane_arm": 1.0}, {"accelerometer_arm": 1.0})
    check.findings = (*airspeed_check("present").findings, *check.findings[len(airspeed) :])
    assert starts_of(check, 0.02) == (
        {"airspeed_alpha_slope": -0.5, "vane_arm": 1.0},
        {"accelerometer_arm": 1.0, "airspeed_alpha_slope": -0.5},
        {"airspeed_alpha_slope": -0.5},
    )
    check.verdict = "failed"
    assert starts_of(check, 0.02) == starts_of(None, 0.02) == ()


@pytest.mark.parametrize(("lag_s", "names"), [(0.0099, ()), (0.0101, ({"vane_lag": 0.0101},))])
def test_a_time_of_half_a_sample_is_no_error(lag_s, names):
    check = airspeed_check("not needed")
    check.possible = (SimpleNamespace(errors=(error("vane_lag", lag_s, "s"),)),)
    check.findings = (Finding("vane_lag", "s", "", lag_s, 0.001, 0.0, 0.02, 0.0, 0.001, "present"),)
    assert starts_of(check, 0.02) == names


def test_a_position_error_of_the_check_is_a_prior():
    """The prior has the check's estimate; it is no more than six standard errors from none: hypot(0.02, 0.5/6)."""
    check, effect = airspeed_check("present"), EFFECTS["airspeed_alpha_slope"]
    ((only,),) = (e.parameters for e in within_kinematics([effect], check))
    assert (only.prior_mean, only.prior_std) == pytest.approx((-0.5, 0.0856997), abs=1e-6)
    assert (only.low, only.high) == pytest.approx((-0.6, 0.0))
    ((none,),) = (e.parameters for e in within_kinematics([effect], airspeed_check("not needed")))
    assert none.prior_std == float("inf")


def test_an_answer_without_the_position_error_of_the_check_is_provisional():
    lift = AcceptedEffect("cl_alpha_nonlinear", {}, 1e-9, 5.0)
    (note,) = disagreement(airspeed_check("present"), SimpleNamespace(effects=(lift,)), 0.02)
    assert note.startswith(
        "the airspeed contradicts ax, az and theta unless its reading changes with the angle"
    )
    assert disagreement(airspeed_check("not needed"), SimpleNamespace(effects=(lift,)), 0.02) == []
    own = AcceptedEffect(
        "airspeed_alpha_slope", {"slope_per_rad": ParameterEstimate(-0.5, 0.02, (-0.54, -0.46))}, 1e-9, 5.0
    )
    assert disagreement(airspeed_check("present"), SimpleNamespace(effects=(own,)), 0.02) == []


def test_half_a_sample_is_no_contradiction():
    """A gyro late by 13 ms, which the trace does not name: of 20 Hz samples a quarter, of 50 Hz samples two thirds."""
    found = Finding("gyro_lag", "s", "", 0.013, 0.001, 0.011, 0.015, 0.0, 0.004, "present")
    check = SimpleNamespace(verdict="errors", possible=(SimpleNamespace(errors=(found,)),), findings=(found,))
    own = ParameterEstimate(0.08, 0.001, (0.078, 0.082))
    answer = SimpleNamespace(effects=(AcceptedEffect("vane_lag", {"tau_s": own}, 1e-9, 5.0),))
    assert disagreement(check, answer, 0.05) == []
    (note,) = disagreement(check, answer, 0.02)
    assert "names gyro_lag" in note
    # an estimate is compared with the same margin: 15 ms and 25 ms against 41 ms
    late = AcceptedEffect("gyro_lag", {"tau_s": replace(own, ci95=(0.041, 0.045))}, 1e-9, 5.0)
    assert len(disagreement(check, SimpleNamespace(effects=(late,)), 0.05)) == 1
    assert disagreement(check, SimpleNamespace(effects=(late,)), 0.06) == []


@dataclass(frozen=True)
class Answer:
    """The fields of an answer that a contradiction concerns."""

    effects: tuple[AcceptedEffect, ...]
    provisional: bool = False
    notes: tuple[str, ...] = ()
    verdict: str = "traced"
    anomaly: object = None
    remaining: object = None


def allowed(errors=(), p_value=0.5, state="not needed"):
    """Range of a gyro scale and of an inertia beside a check that estimates a scale of 1.002 +- 0.004."""
    found = Finding("gyro_scale", "-", "", 1.002, 0.004, 0.994, 1.01, 1.0, 0.015, state)
    check = SimpleNamespace(
        p_value=p_value, possible=(SimpleNamespace(errors=errors),), findings=(found,), verdict="agrees"
    )
    effects = within_kinematics([EFFECTS["gyro_scale"], EFFECTS["inertia_error"]], check)
    return [(e.parameters[0].low, e.parameters[0].high) for e in effects]


def test_a_check_without_an_error_limits_what_a_trace_may_name():
    """Five standard errors about the estimate; effects that are no error of a sensor keep their range."""
    plain = [(e.low, e.high) for e in (EFFECTS[k].parameters[0] for k in ("gyro_scale", "inertia_error"))]
    assert allowed() == [pytest.approx((0.982, 1.022)), plain[1]]
    assert allowed(errors=(SimpleNamespace(name="vane_lag"),)) == plain
    assert allowed(p_value=0.01) == plain
    assert allowed(state="not shown") == plain
    assert list(within_kinematics([EFFECTS["gyro_scale"]], None)) == [EFFECTS["gyro_scale"]]


@pytest.mark.parametrize(
    ("verdict", "p_value", "expected"),
    [("none", 1e-7, "unexplained"), ("none", 1e-5, "none"), ("traced", 1e-7, "traced")],
)
def test_channels_that_contradict_each_other_are_not_nothing(verdict, p_value, expected):
    """A gyro that is late in one record of four leaves no trace in the fit of all."""
    check = SimpleNamespace(verdict="cannot_tell", p_value=p_value, statistic=300.0, possible=(), findings=())
    found = with_contradictions(Answer((), verdict=verdict), check, 0.02)
    assert found.verdict == expected
    if expected == "unexplained":
        assert found.remaining.p_value == found.anomaly.p_value == p_value
        assert "single records" in found.notes[0]
