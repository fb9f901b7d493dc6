"""The vocabulary of sensor errors: one table from which file, effect, filter and simulator derive theirs."""

from __future__ import annotations

from dataclasses import fields
from typing import get_args

import numpy as np
import pytest

from airtruth.aircraft import Sensor
from airtruth.physics.sensor_errors import KINDS, Kind, SensorErrors, error_name
from airtruth.physics.sensors import at_instrument, measure
from airtruth.quantity import Quantity
from airtruth.units import UNITS


def test_every_error_has_one_kind() -> None:
    assert {kind.field for kind in KINDS.values()} == {f.name for f in fields(SensorErrors)}
    assert {kind.key for kind in KINDS.values()} == set(Sensor.model_fields)
    assert set(get_args(Kind)) < set(KINDS)
    assert {kind.dimension for kind in KINDS.values()} - {""} <= set(UNITS)


def test_neutral_values_are_the_defaults_and_change_nothing() -> None:
    perfect = SensorErrors()
    assert Sensor().errors() == perfect
    assert {name: perfect.value(name) for name in KINDS} == {n: k.neutral for n, k in KINDS.items()}
    truth = np.random.default_rng(0).standard_normal((2, 50))
    np.testing.assert_array_equal(measure(perfect, truth, 0.02, np.ones_like(truth)), truth)
    assert at_instrument("alpha_rad", {"alpha_rad": truth}, perfect) is truth


@pytest.mark.parametrize("kind", KINDS)
def test_a_declared_entry_reaches_its_error(kind: str) -> None:
    declared = Sensor.model_construct(**{KINDS[kind].key: Quantity(value=0.25)})
    assert declared.errors().value(kind) == 0.25


def test_scale_and_bias_are_undone() -> None:
    """y = 1.1 x - 0.5 by hand: 2 reads 1.7."""
    errors = SensorErrors(scale=1.1, bias=-0.5)
    reading = errors.scaled(np.array([2.0, -1.0]))
    np.testing.assert_allclose(reading, [1.7, -1.6], rtol=1e-15)
    np.testing.assert_allclose(errors.unscaled(reading), [2.0, -1.0], rtol=1e-15)


@pytest.mark.parametrize("kind", get_args(Kind))
def test_a_neutral_error_in_series_changes_nothing(kind: Kind) -> None:
    assert KINDS[kind].combined(0.37, KINDS[kind].neutral) == 0.37


@pytest.mark.parametrize(
    ("channel", "kind", "name"),
    [
        ("alpha_rad", "arm", "vane_arm"),
        ("q_rad_s", "lag", "gyro_lag"),
        ("az_m_s2", "bias", "accelerometer_bias"),
        ("airspeed_m_s", "scale", "airspeed_scale"),
        ("theta_rad", "delay", "sensor_delay:theta_rad"),
    ],
)
def test_names(channel: str, kind: Kind, name: str) -> None:
    """The names that trace.json fixes (contract 3)."""
    assert error_name(channel, kind) == name
