"""Numbers of a campaign that would fill the memory or take minutes are refused by name, in less than seconds."""

import tomllib

import numpy as np
import pytest

from airtruth.errors import AirtruthError, ConfigurationError
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.manoeuvres import SEARCHED_HARMONICS, Manoeuvre, sample

T = np.arange(1001) / 200.0

CAMPAIGN = tomllib.loads(
    """
    schema = 1
    name = "limits"
    aircraft = "gtm"
    runs = 1
    duration_s = 5.0
    condition = { eas_kt = 75.0, altitude_ft = 7000.0 }
    manoeuvre = [{ kind = "doublet", amplitude_deg = 1.0 }]
    """
)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"duration_s": 1e-308}, "duration = 1e-308 s is shorter than a log sample"),
        ({"log_hz": 1e-300}, "duration = 5 s is shorter than a log sample"),
        ({"duration_s": 3600.0, "simulation_hz": 10_000.0, "log_hz": 10_000.0}, "a run may have 4e+06"),
        ({"runs": 10_000_000}, "runs: Input should be less than or equal to 1000000"),
        (
            {"condition": {"eas_kt": 1e300, "altitude_ft": 0.0}},
            "value is 5.14444e+299; write a number between",
        ),
        ({"condition": {"eas_kt": {"choose": [1e300]}, "altitude_ft": 0.0}}, "choose is 5.14444e+299"),
        ({"condition": {"eas_kt": float("nan"), "altitude_ft": 0.0}}, "finite number"),
        ({"duration_s": float("inf")}, "finite number"),
        ({"sensors": {"channel": {"q_rad_s": {"delay": {"value": 1e300, "unit": "s"}}}}}, "value is 1e+300"),
        ({"effect": [{"name": "elevator_delay", "delay_s": 1e300}]}, "outside its range of 0 to 0.2 s"),
        ({"duration_s": True}, "duration: write a number (got True)"),
        ({"runs": "7"}, "runs: write a number (got '7')"),
        ({"condition": {"eas_kt": {"choose": ["75"]}, "altitude_ft": 0.0}}, "write a number (got '75')"),
        ({"sensors": {"ideal": 1}}, "sensors.ideal: write true or false (got 1)"),
        ({"condition": 5}, "condition: must be a table (got 5)"),
        ({"condition": {"eas_kt": 75.0}}, "altitude: is required; write altitude_m, altitude_ft"),
        ({"manoeuvre": {}}, "write [[manoeuvre]] with two brackets"),
        ({"manoeuvre": [3]}, "manoeuvre.0: must be a table (got 3)"),
    ],
)
def test_a_number_out_of_range(tmp_path, changes, words):
    from validation.fuzz.mutate import toml

    path = tmp_path / "c.toml"
    path.write_text(toml(CAMPAIGN | changes))
    with pytest.raises(AirtruthError) as caught:
        campaign_file.read(path)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("manoeuvre", "words"),
    [
        (Manoeuvre("multisine", highest_hz=1e6), "above half the simulation rate, 100 Hz"),
        (Manoeuvre("sweep", highest_hz=101.0), "above half the simulation rate, 100 Hz"),
        (Manoeuvre("multisine", highest_hz=99.0, length_s=100.0), "has 9900 harmonics .* shorten it"),
        (Manoeuvre("multisine", length_s=1e9), "shorten it or narrow its band"),
        (Manoeuvre("doublet", step_s=1e-300), "step_s = 1e-300 s is shorter than a simulation step of 5 ms"),
    ],
)
def test_a_manoeuvre_that_the_steps_cannot_follow(manoeuvre, words):
    with pytest.raises(ConfigurationError, match=words):
        sample(manoeuvre, T)


def test_many_harmonics_keep_a_low_peak_without_a_search():
    """Schroeder's phases: the peak factor of a flat spectrum is below 2 (Schroeder, IEEE Trans. IT 16(1), 1970)."""
    many = Manoeuvre(
        "multisine", amplitude_rad=1.0, start_s=0.0, length_s=5.0, lowest_hz=1.0, highest_hz=30.0
    )
    assert SEARCHED_HARMONICS < 5.0 * 29.0
    wave = sample(many, T)
    assert np.abs(wave).max() == pytest.approx(1.0, abs=0.02)
    assert wave.std() > 1.0 / 2.0
