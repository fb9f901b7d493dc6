"""Aircraft that the JSBSim wheel ships, flown through an aircraft.toml of a few lines."""

import numpy as np
import pandas as pd
import pytest
from fly_campaigns import channel, fly
from tiers import sampled

pytestmark = pytest.mark.slow

# EAS [kt], altitude [ft], doublet [deg]. The Cessna's elevator cable has 0.05 rad of slack (c172x.xml).
FLOWN = {"c172x": (80.0, 5000.0, 4.0), "f16": (300.0, 10000.0, 1.0), "T38": (300.0, 10000.0, 1.0)}
START = {"manoeuvre": [{"kind": "doublet", "amplitude_deg": 0.0, "start_s": 0.5, "step_s": 0.5}]}


@pytest.mark.parametrize("name", sampled(FLOWN, 3))
def test_doublet_through_a_few_lines_of_aircraft_toml(tmp_path, name):
    eas, altitude, amplitude = FLOWN[name]
    condition = {"eas_kt": eas, "altitude_ft": altitude}
    doublet = [{"kind": "doublet", "amplitude_deg": amplitude, "start_s": 0.5, "step_s": 0.5}]
    common = {"aircraft": name, "condition": condition, "gust": None, "runs": 1, "duration_s": 2.0}
    out = fly(tmp_path / "doublet", manoeuvre=doublet, **common)
    calm = fly(tmp_path / "calm", **START, **common)
    assert np.ptp(channel(calm, "elevator_rad")) < 1e-6
    moved = {n: channel(out, n)[0] - channel(calm, n)[0] for n in ("elevator_rad", "q_rad_s", "az_m_s2")}
    down, up = slice(30, 50), slice(55, 75)
    # Trailing edge down is positive in every log whatever the model's own sign, and pitches nose down.
    assert moved["elevator_rad"][down].max() > 0.4 * np.deg2rad(amplitude)
    assert moved["elevator_rad"][down].max() < 1.1 * np.deg2rad(amplitude)
    assert moved["elevator_rad"][up].min() < -0.4 * np.deg2rad(amplitude)
    assert moved["q_rad_s"][down].min() < -1e-3
    assert channel(calm, "az_m_s2")[0, 0] == pytest.approx(-9.8, abs=0.15)
    truth = pd.read_parquet(out / "truth.parquet").iloc[0]
    assert truth["status"] == "ok"
    assert truth["CLalpha"] > 2.0
    assert truth["Cmde"] < 0.0


@pytest.mark.parametrize("name", FLOWN)
def test_foreign_aircraft_fly_in_gusts(tmp_path, name):
    eas, altitude, _ = FLOWN[name]
    out = fly(
        tmp_path,
        aircraft=name,
        condition={"eas_kt": eas, "altitude_ft": altitude},
        runs=2,
        **START,
        gust={"level": "light", "figures": "mil-f-8785c"},
    )
    assert (channel(out, "alpha_rad").std(axis=1) > 1e-4).all()


@pytest.mark.parametrize("eas_kt", [70.0, 85.0, 90.0, 100.0])
def test_the_cessna_can_be_trimmed_at_its_usual_speeds(tmp_path, eas_kt):
    fly(
        tmp_path,
        aircraft="c172x",
        condition={"eas_kt": eas_kt, "altitude_ft": 4000.0},
        gust=None,
        runs=1,
        **START,
    )
