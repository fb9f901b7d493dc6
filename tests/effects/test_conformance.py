"""What every effect of the library keeps, those that other packages bring too."""

import math
from dataclasses import replace
from typing import get_args, get_type_hints

import effect_flights as flights
import numpy as np
import pytest
from tiers import sampled

from airtruth.aircraft import Sensor
from airtruth.aircraft.neutral import effective, fitted
from airtruth.channels import SIGNALS as LOG_CHANNELS
from airtruth.effects.registry import EFFECTS
from airtruth.effects.sensors import sensor_effects
from airtruth.errors import ConfigurationError
from airtruth.physics.composition import CAUSES, TailGeometry, directions
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS
from airtruth.physics.sensor_errors import Kind
from airtruth.physics.terms import (
    DECLARED,
    SHAPES,
    STATE_KINDS,
    AirTerm,
    Change,
    SurfaceTerm,
    coefficients_of,
    signals_of,
)
from airtruth.simulation import instruments as measure
from airtruth.units import UNITS

ALL = sorted(EFFECTS)
LONG = [key for key in ALL if EFFECTS[key].applies_to(LONGITUDINAL)]
SIDE = [key for key in ALL if key not in LONG]
DELAY = EFFECTS["elevator_delay"].change({"delay_s": 0.03})
LATE = EFFECTS["aileron_delay"].change({"delay_s": 0.03}) + EFFECTS["rudder_delay"].change({"delay_s": 0.03})


def kinds(term, field):
    """Values that the type of a term's field allows."""
    return get_args(get_type_hints(term)[field])


def values(effect, share):
    """Parameter values at a multiple of the material size; places in the middle of their range, further sizes none."""
    size, *others = effect.parameters
    found = {p.name: 0.5 * (p.low + p.high) if p.is_location else p.neutral for p in others}
    return {size.name: size.value(share * size.material)} | found


def neutral(effect):
    size, *_ = effect.parameters
    return values(effect, 1.0) | {size.name: size.neutral}


@pytest.mark.parametrize("key", ALL)
def test_parameters_are_consistent(key):
    effect = EFFECTS[key]
    size, *others = effect.parameters
    assert effect.key == key
    assert not size.is_location
    assert all(p.is_location or effect.in_derivatives for p in others)
    assert effect.in_derivatives == bool(effect.change(values(effect, 1.0)).derivatives)
    assert effect.explanation.endswith(".")
    assert effect.source
    assert effect.where in ("surface", "dynamics", "declared", "sensor", "air")
    assert set(effect.channels) <= set(LOG_CHANNELS)
    assert len({p.name for p in effect.parameters}) == len(effect.parameters)
    assert size.material > 0.0
    for p in effect.parameters:
        assert p.low < p.high
        assert p.step > 0.0
        assert p.unit == "-" or any(p.unit in units for units in UNITS.values())
        assert p.unit == "-" or p.name == "value" or p.name.endswith(f"_{p.unit}")
        for value in np.linspace(p.low, p.high, 5):
            if p.reciprocal and value <= 0.0:
                continue
            assert p.value(p.size(value)) == pytest.approx(value, rel=1e-12, abs=1e-15)
    assert size.size(size.neutral) == 0.0
    assert size.value(0.0) == size.neutral
    assert size.one_sided or size.low < size.neutral < size.high
    assert size.low <= size.value(size.material) <= size.high


@pytest.mark.parametrize("key", ALL)
def test_values_are_checked(key):
    effect = EFFECTS[key]
    good = values(effect, 1.0)
    assert effect.read(good) == good
    with pytest.raises(ConfigurationError, match=r"is missing \(.*write one of"):
        effect.read({})
    with pytest.raises(ConfigurationError, match=r"is not a parameter; .*allowed"):
        effect.read(good | {"nonsense": 1.0})
    name = effect.parameters[0].name
    with pytest.raises(ConfigurationError, match="outside its range"):
        effect.read(good | {name: 1e9})
    with pytest.raises(ConfigurationError, match="has to be a number"):
        effect.read(good | {name: "much"})
    with pytest.raises(ConfigurationError, match="not a number"):
        effect.change(good | {name: math.nan})


@pytest.mark.parametrize("key", ALL)
def test_change_is_in_plain_known_terms(key):
    effect = EFFECTS[key]
    change = effect.change(values(effect, 3.0))
    assert change != Change()
    assert effective(change) == change
    motions = [m for m in MOTIONS.values() if effect.applies_to(m)]
    known = {signal for m in motions for signal in signals_of(m)}
    signals = {*known, *(s.name for s in change.states)}
    assert all(t.kind in kinds(SurfaceTerm, "kind") for t in change.surface)
    assert all(t.kind in STATE_KINDS and t.signal in known and t.time_s > 0.0 for t in change.states)
    assert all(t.coefficient in {c for m in motions for c in coefficients_of(m)} for t in change.aero)
    assert all(t.shape in SHAPES for t in change.aero)
    assert all(t.signal in signals for t in change.aero)
    assert all(t.quantity in DECLARED for t in change.declared)
    assert all(t.cause in CAUSES for t in change.derivatives)
    assert all(t.kind in get_args(Kind) and t.channel in LOG_CHANNELS for t in change.sensors)
    assert all(t.level in kinds(AirTerm, "level") for t in change.air)


@pytest.mark.parametrize("key", ALL)
def test_it_concerns_a_motion(key):
    """Every name in its terms is one of a motion, or the tracer could not fly it."""
    assert any(EFFECTS[key].applies_to(motion) for motion in MOTIONS.values())


def test_an_effect_concerns_a_motion_that_has_all_its_names():
    shared = {key for key in ALL if EFFECTS[key].applies_to(LATERAL)}
    assert {"mass_error", "airspeed_scale", "airspeed_alpha_slope", "cg_shift"} <= shared
    assert not shared & {
        "inertia_error",
        "elevator_effectiveness",
        "accelerometer_lag",
        "downwash_lag",
        "gust_level",
    }


@pytest.mark.parametrize("key", [key for key in ALL if EFFECTS[key].prior])
def test_a_cause_of_changed_derivatives_has_a_direction_and_a_plausible_range(key):
    effect = EFFECTS[key]
    motion = LONGITUDINAL if key in LONG else LATERAL
    derivatives = np.arange(1.0, 1.0 + len(motion.parameters))
    assert np.any(directions(derivatives, TailGeometry(), motion)[effect.quantity])
    assert effect.prior.std > 0.0
    assert effect.prior.low <= 0.0 < effect.prior.high


def test_sensor_errors_follow_from_outputs_and_kinds():
    """Lag, scale, bias and delay of each output; an arm where the position matters; one delay of each control."""
    keys = [e.key for e in sensor_effects(LONGITUDINAL)]
    of_outputs = 4 * len(LONGITUDINAL.outputs)
    arms = [key for key in keys if key.endswith("_arm")]
    of_airspeed = [key for key in keys if key.startswith("airspeed")]
    assert (arms, len(of_airspeed)) == (["vane_arm", "accelerometer_arm"], 2)
    assert (
        len(set(keys)) == len(keys) == of_outputs + len(arms) + len(of_airspeed) + len(LONGITUDINAL.controls)
    )


@pytest.mark.parametrize("key", ALL)
def test_neutral_changes_nothing(key):
    effect = EFFECTS[key]
    assert effective(effect.change(neutral(effect))) == Change()
    assert effect.read(neutral(effect)) == neutral(effect)


@pytest.mark.parametrize("key", ALL)
def test_effects_compose(key):
    effect = EFFECTS[key]
    change = effect.change(values(effect, 3.0))
    assert change + Change() == change == Change() + change
    both = effective(change + DELAY)
    assert both.surface == change.surface + DELAY.surface
    assert both.of_surface("elevator") == change.of_surface("elevator") + DELAY.surface
    for field in ("aero", "declared", "derivatives", "sensors", "air"):
        assert getattr(both, field) == getattr(change, field)


def test_a_written_aircraft_without_a_change_flies_the_same_bits(gtm, paper_condition, tmp_path):
    plane = flights.changed(gtm, EFFECTS["mass_error"].change({"factor": 1.0}), tmp_path)
    assert (plane.file, plane.constants) == (gtm.file, gtm.constants)
    _, before = flights.fly(gtm, paper_condition)
    _, after = flights.fly(plane, paper_condition)
    for name, channel in before.items():
        np.testing.assert_array_equal(after[name], channel)


@pytest.fixture(scope="module")
def plain(gtm, paper_condition):
    return flights.fly(gtm, paper_condition)[1]


@pytest.fixture(scope="module")
def level(paper_condition):
    return replace(paper_condition, straight="wings-level")


@pytest.fixture(scope="module")
def rolled(gtm, level):
    return flights.fly_lateral(gtm, level)[1]


def distance(flown, plain, channels=("alpha_rad", "q_rad_s", "az_m_s2")):
    """Largest change of a channel's motion over that motion."""
    found = []
    for name in channels:
        motion = plain[name] - plain[name][0]
        found.append(np.abs(flown[name] - flown[name][0] - motion).max() / np.abs(motion).max())
    return max(found)


def in_aircraft(keys):
    return [k for k in keys if EFFECTS[k].change(values(EFFECTS[k], 1.0)).in_aircraft]


def grows_and_composes(effect, fly, distance, delay):
    material = fly(effect.change(values(effect, 3.0)), "material")
    seen = distance(material)
    assert seen > 1e-4, "three times the material size does not move the aircraft"
    assert distance(fly(effect.change(values(effect, 0.003)), "little")) < 0.01 * seen + 1e-12
    both = fly(effect.change(values(effect, 3.0)) + delay, "both")
    assert distance(both) > 0.5 * seen
    return both, material


@pytest.mark.parametrize("key", sampled(in_aircraft(LONG), 4))
def test_written_effect_grows_from_nothing_and_composes(gtm, paper_condition, plain, tmp_path, key):
    def fly(change, name):
        plane = flights.changed(gtm, change, tmp_path / name, paper_condition)
        return flights.fly(plane, paper_condition)[1]

    both, material = grows_and_composes(EFFECTS[key], fly, lambda flown: distance(flown, plain), DELAY)
    assert distance(both, material) > 1e-3


SIDE_CHANNELS = ("beta_rad", "p_rad_s", "r_rad_s", "ay_m_s2")


@pytest.mark.parametrize("key", sampled(in_aircraft(SIDE), 4))
def test_written_lateral_effect_grows_from_nothing_and_composes(gtm, level, rolled, tmp_path, key):
    def fly(change, name):
        plane = flights.changed(gtm, change, tmp_path / name, level)
        return flights.fly_lateral(plane, level)[1]

    def seen(flown):
        return distance(flown, rolled, SIDE_CHANNELS)

    both, material = grows_and_composes(EFFECTS[key], fly, seen, LATE)
    assert distance(both, material, SIDE_CHANNELS) > 1e-3


@pytest.mark.parametrize("key", [k for k in ALL if EFFECTS[k].where == "sensor"])
def test_sensor_effect_shows_in_its_channel_alone(plain, rolled, key):
    effect = EFFECTS[key]
    truth = {name: channel[None] for name, channel in (plain if key in LONG else rolled).items()}
    terms = effect.change(values(effect, 3.0)).sensors
    errors = {name: sensor.errors() for name, sensor in fitted({}, terms).items()}
    before = measure.log_channels(truth, {}, {}, 1 / 200, 4)
    after = measure.log_channels(truth, errors, {}, 1 / 200, 4)
    moved = {name for name in before if not np.array_equal(before[name], after[name])}
    assert moved == {t.channel for t in terms}


def test_sensor_terms_come_on_top_of_what_is_declared():
    terms = tuple(
        t
        for name, amount in (
            ("vane_scale", {"factor": 1.1}),
            ("vane_bias", {"value": 0.01}),
            ("vane_arm", {"x_m": 0.3}),
            ("vane_lag", {"tau_s": 0.02}),
            ("sensor_delay:alpha_rad", {"delay_s": 0.04}),
        )
        for t in EFFECTS[name].change(amount).sensors
    )
    declared = Sensor.model_validate(
        {
            "scale": {"value": 2.0},
            "bias": {"value": -0.02},
            "x": {"value": 1.0},
            "delay": {"value": 0.01},
            "noise_std": {"value": 0.001},
        }
    )
    sensor = fitted({"alpha_rad": declared}, terms)["alpha_rad"]
    found = [getattr(sensor, k).value for k in ("scale", "bias", "x", "lag", "delay", "noise_std")]
    assert found == pytest.approx([2.2, -0.01, 1.3, 0.02, 0.05, 0.001], rel=1e-15)
    with pytest.raises(ConfigurationError, match=r"can reduce it by 0 s at most"):
        fitted({}, EFFECTS["vane_lag"].change({"tau_s": -0.1}).sensors)
