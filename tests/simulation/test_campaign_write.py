"""A campaign written as a file is read as the same campaign."""

from pathlib import Path

import pytest

from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.write import as_toml

SHIPPED = sorted((Path(__file__).resolve().parents[2] / "data" / "campaigns").glob("*.toml"))
FULL = {
    "name": "full",
    "title": 'quotes " and umlauts ü',
    "aircraft": "gtm",
    "runs": 2,
    "duration_s": 6.0,
    "condition": {"eas_kt": {"mean": 75.0, "std": 1.0}, "altitude_ft": {"low": 5000.0, "high": 7000.0}},
    "manoeuvre": [
        {"kind": "multistep", "amplitude_deg": {"choose": [-1.0, 1.0]}, "segments_ms": [400.0, 300.0],
         "levels": [1.0, -0.5], "rise_ms": 50.0},
        {"kind": "harmonics", "amplitude_deg": 1.0, "length_s": 4.0, "harmonics": [1, 3], "weights": [1.0, 0.5],
         "phases_deg": [10.0, 20.0]},
    ],
    "gust": {"level": "moderate", "factor": 0.5},
    "sensors": {"channel": {"q_rad_s": {"noise_std": {"value": 0.2, "unit": "deg_s"}, "bias": {"value": 0.0, "unit": "deg_s"}}}},
    "effect": [{"name": "elevator_delay", "delay_ms": 8.0},
               {"name": "cm_alpha_nonlinear", "variant": "quadratic", "Cmalpha2": 2.0}],
}  # fmt: skip


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_shipped_campaigns_survive(path, tmp_path):
    made = campaign_file.read(path)
    (tmp_path / "again.toml").write_text(as_toml(made, "a comment\nof two lines"), encoding="utf-8")
    assert campaign_file.read(tmp_path / "again.toml") == made


def test_every_kind_of_entry_survives(tmp_path):
    made = Campaign.model_validate(FULL)
    (tmp_path / "again.toml").write_text(as_toml(made), encoding="utf-8")
    again = campaign_file.read(tmp_path / "again.toml")
    assert again == made
    assert again.manoeuvre[0].rise == pytest.approx(0.05)
