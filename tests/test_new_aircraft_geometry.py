"""`airtruth new aircraft` from the geometry."""

import subprocess
import sys

import pytest

from airtruth import aircraft
from airtruth.errors import ConfigurationError
from airtruth.physics import handbook
from airtruth.starting import Measured, proposed_aircraft
from airtruth.starting.geometry import TAIL_ASPECT_RATIO

KNOWN = {"span_m": 1.9, "wing_area_m2": 0.42, "tail_area_m2": 0.075, "tail_arm_m": 0.75, "mass_kg": 3.0}
OPTIONS = [word for key, value in KNOWN.items() for word in (f"--{key.replace('_', '-')}", str(value))]


def test_the_file_holds_the_formulas_and_their_scatter(tmp_path):
    command = [sys.executable, "-m", "airtruth", "new", "aircraft", "--out", "uav"]
    done = subprocess.run(
        [*command, *OPTIONS, "--length-m", "1.3"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    plane = aircraft.load(tmp_path / "uav")
    chord = 0.42 / 1.9
    planform = handbook.Planform(1.9, 0.42, chord, (TAIL_ASPECT_RATIO * 0.075) ** 0.5, 0.075, 0.75)
    expected, stds = handbook.derivatives(planform), handbook.standard_deviations(planform)
    for name, quantity in plane.file.derivatives.items():
        assert quantity.value == pytest.approx(expected[name], rel=1e-3)
        assert quantity.std == pytest.approx(stds[name], rel=0.06)  # two digits
        assert quantity.source.startswith("handbook, eq.")
    assert plane.inertia_yy_kg_m2 == pytest.approx(3.0 * (0.18 * 1.3) ** 2, rel=1e-5)
    assert plane.file.tail.arm.value == 0.75
    assert "airtruth trace LOG.parquet" in done.stdout


def test_what_is_missing_is_named():
    with pytest.raises(ConfigurationError, match=r"--tail-arm-m, --inertia-kg-m2 or --length-m"):
        proposed_aircraft("uav", Measured(**{k: v for k, v in KNOWN.items() if k != "tail_arm_m"}))
    with pytest.raises(ConfigurationError, match=r"--span-m -1: has to be a number above 0"):
        proposed_aircraft("uav", Measured(**KNOWN | {"span_m": -1.0, "length_m": 1.0}))
