"""Elevons whose servos are mirrored: the mean of their columns holds the roll and no elevator."""

import numpy as np
import pytest
from import_flight import DEG, write_csv
from pydantic import ValidationError

from airtruth.errors import LogError
from airtruth.importers import import_log
from airtruth.importers.mapping import MappingFile
from airtruth.importers.mirrored import are_mirrored
from validation.linear_flight import fly

CHANNELS = ("airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s", "ax_m_s2", "az_m_s2", "density_kg_m3")


@pytest.fixture(scope="module")
def flown():
    batch = fly(rate_hz=50, duration_s=10.0, gust=0.2, noise=0.5, seed=8)
    return batch.t_s[0], {name: values[0] for name, values in batch.channels.items()}


def elevons(c, t, pitch):
    """Pulse widths of both servos, 10 us for each degree, with a roll larger than the elevator."""
    elevator, roll = c["elevator_rad"] / DEG, 5.0 * np.sin(1.3 * t)
    return np.stack([1500.0 + 10.0 * (roll + elevator), 1500.0 + 10.0 * (roll + pitch * elevator)])


@pytest.mark.parametrize("rate", [1.0, 1.0 / DEG])
def test_mirrored_servos_are_told_from_others(flown, rate):
    t, c = flown
    q = rate * c["q_rad_s"]
    assert are_mirrored(t, elevons(c, t, -1.0), t, q)
    assert are_mirrored(t[1::2], elevons(c, t, -1.0)[:, 1::2], t, q)
    both, roll = elevons(c, t, 1.0), np.array([[1.0], [-1.0]]) * 50.0 * np.sin(1.3 * t)
    assert not are_mirrored(t, both, t, q)
    assert not are_mirrored(t, c["elevator_rad"] + roll, t, q)
    noise = np.random.default_rng(1).normal(size=(2, t.size))
    assert not are_mirrored(t, noise, t, q)


def test_the_import_names_the_weights(flown, tmp_path):
    t, c = flown
    left, right = elevons(c, t, -1.0)
    write_csv(tmp_path / "f.csv", {"t": t, "L": left, "R": right, **{n: c[n] for n in CHANNELS if n in c}})
    units = ("m_s", "rad", "rad", "rad_s", "m_s2", "m_s2", "kg_m3")
    channels = {n: {"column": n, "unit": u} for n, u in zip(CHANNELS, units, strict=True) if n in c}
    linear = {"scale": 0.1, "offset": -150.0}
    points = {"calibration": [[1400.0, -10.0], [1600.0, 10.0]]}

    def read(elevator, aileron=None):
        stated = {
            name: {"columns": ["L", "R"], "unit": "deg", **own}
            for name, own in (("elevator_rad", elevator), ("aileron_rad", aileron))
            if own is not None
        }
        mapping = {"time": {"column": "t"}, "channels": channels | stated}
        return import_log(tmp_path / "f.csv", MappingFile.model_validate(mapping)).log.channels

    for mean in (linear, points):
        with pytest.raises(
            LogError, match=r"difference of 'L' and 'R'.*weights = \[0.5, -0.5\] under.*\[-0.5, -0.5\] if 'L'"
        ):
            read(mean)
    difference, half_sum = {"weights": [0.5, -0.5]}, {"weights": [-0.5, -0.5]}
    roll_rad = -5.0 * DEG * np.sin(1.3 * t)  # right less left, trailing edge down
    for made in (
        read({"scale": 0.1, **difference}, {"scale": 0.1, "offset": 150.0, **half_sum}),
        read(points | difference, points | half_sum),
        read({"calibration": [[[1400, -10], [1600, 10]], [[1400, 10], [1600, -10]]]}),
    ):
        np.testing.assert_allclose(made["elevator_rad"], c["elevator_rad"], atol=1e-6)
        np.testing.assert_allclose(made.get("aileron_rad", roll_rad), roll_rad, atol=1e-6)
    with pytest.raises(ValidationError, match=r"aileron_rad is a multiple of channels.elevator_rad"):
        read(points | difference, points | {"weights": [-0.5, 0.5]})
