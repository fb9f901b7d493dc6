"""Campaign files that cannot be flown: one message with what, where and what is allowed; exit code 2."""

import numpy as np
import pytest
from fly_campaigns import GUST, channel, command, fly, write

DOUBLET = {"kind": "doublet", "amplitude_deg": 2.0, "start_s": 0.5, "step_s": 0.25}
LEVEL = {"eas_kt": 75.0, "altitude_ft": 7000.0}
Q_NOISE = {"channel": {"q_rad_s": {"noise_std": {"value": -0.1, "unit": "deg_s"}}}}
THETA_IN_KT = {"channel": {"theta_rad": {"noise_std": {"value": 0.1, "unit": "kt"}}}}

BAD = {
    "misspelt key": ({"durations_s": 2.0}, ["durations_s: unknown key", "did you mean 'duration_s'?"]),
    "misspelt key below": (
        {"manoeuvre": [DOUBLET | {"stop_s": 1.0}]},
        ["manoeuvre.0", "stop_s: unknown key", "step_s"],
    ),
    "wrong unit": (
        {"condition": {"eas_ft": 75.0, "altitude_ft": 7000.0}},
        ["eas_ft", "'ft' is not a unit of speed", "eas_kt"],
    ),
    "no unit": (
        {"condition": {"eas": 75.0, "altitude_ft": 7000.0}},
        ["eas: the unit is missing", "eas_m_s"],
    ),
    "two units": ({"condition": LEVEL | {"eas_m_s": 40.0}}, ["eas is given twice, in two units"]),
    "missing": ({"condition": {"eas_kt": 75.0}}, ["condition.altitude", "required"]),
    "negative noise": ({"sensors": Q_NOISE}, ["sensors", "q_rad_s", "noise_std", "must not be negative"]),
    "sensor's unit": (
        {"sensors": THETA_IN_KT},
        ["theta_rad.noise_std: unit 'kt' is not a unit of angle", "deg"],
    ),
    "unknown channel": (
        {"sensors": {"channel": {"alfa_rad": {}}}},
        ["'alfa_rad' is not a channel", "did you mean 'alpha_rad'"],
    ),
    "negative spread": (
        {"condition": LEVEL | {"eas_kt": {"mean": 75.0, "std": -1.0}}},
        ["condition", "eas", "greater than or equal to 0"],
    ),
    "half a distribution": (
        {"condition": LEVEL | {"eas_kt": {"mean": 75.0}}},
        ["condition.eas", "{ mean, std }, { low, high }"],
    ),
    "unknown aircraft": ({"aircraft": "gtn"}, ["aircraft 'gtn' not found", "did you mean 'gtm'?", "c172x"]),
    "unknown manoeuvre": (
        {"manoeuvre": [DOUBLET | {"kind": "dublet"}]},
        ["manoeuvre.0.kind", "did you mean 'doublet'"],
    ),
    "parts": (
        {"manoeuvre": [DOUBLET | {"kind": "multisine", "parts": 501}]},
        ["manoeuvre.0.parts", "less than or equal to 500"],
    ),
    "one bracket": ({"manoeuvre": DOUBLET}, ["write [[manoeuvre]] with two brackets"]),
    "no amplitude": ({"manoeuvre": [{"kind": "doublet"}]}, ["manoeuvre.0", "amplitude is missing"]),
    "limits of a sensor": (
        {
            "sensors": {
                "channel": {
                    "alpha_rad": {
                        "minimum": {"value": 5, "unit": "deg"},
                        "maximum": {"value": -5, "unit": "deg"},
                    }
                }
            }
        },
        ["alpha_rad", "minimum has to be below maximum"],
    ),
    "strong tailwind": (
        {"wind": {"along_track_kt": 90.0, "keeps": "ground_speed"}},
        ["wind.along_track", "leaves an airspeed of -"],
    ),
    "no manoeuvre": ({"manoeuvre": []}, ["at least one [[manoeuvre]] is needed"]),
    "unknown level": ({"gust": {"level": "ligth"}}, ["gust.level", "did you mean 'light'"]),
    "unknown figures": ({"gust": GUST | {"figures": "nasa"}}, ["gust.figures", "'nasa' is not known", "gtm"]),
    "gust start": ({"gust": GUST | {"start": "stationnary"}}, ["gust.start", "'rest' or 'stationary'"]),
    "no runs": ({"runs": 0}, ["runs", "greater than or equal to 1"]),
    "negative seed": ({"seed": -1}, ["seed", "greater than or equal to 0"]),
    "rates": ({"log_hz": 60.0}, ["log_hz = 60 must divide simulation_hz = 200"]),
    "part of a sample": (
        {"duration_s": 2.001},
        ["duration = 2.001 s must be a whole number of log samples of 0.02 s"],
    ),
    "untrimmable": (
        {"condition": LEVEL | {"eas_kt": 15.0}},
        ["gtm cannot be trimmed at EAS 15.0 kt, 7000 ft", "residual", "Choose another speed"],
    ),
    "position limit": (
        {"manoeuvre": [DOUBLET | {"amplitude_deg": 25.0}]},
        [
            "manoeuvre.0: the command reaches -24.8 to 25.2 deg",
            "allowed -30 to 20 deg",
            "Lower amplitude_deg",
        ],
    ),
    "rate limit": (
        {"manoeuvre": [DOUBLET | {"amplitude_deg": 15.0}]},
        [
            "manoeuvre.0: the surface would have to move faster than the servo's 300 deg/s",
            "lower amplitude_deg",
        ],
    ),
    "edge off the grid": (
        {"manoeuvre": [DOUBLET | {"start_s": 0.503}]},
        ["manoeuvre.0: the manoeuvre has an edge at 0.503 s", "grid of 5 ms", "move it to 0.505 s"],
    ),
    "past the end": (
        {"manoeuvre": [DOUBLET | {"start_s": 1.75}]},
        ["manoeuvre.0: it ends at 2.25 s, after the run of 2 s", "lengthen duration_s"],
    ),
    "replay without a log": (
        {"manoeuvre": [{"kind": "replay"}]},
        ["kind = 'replay' and file = '...' go together"],
    ),
    "gust altitude": (
        {"condition": LEVEL | {"altitude_ft": 20000.0}},
        ["gust figures 'gtm' cover 800 to 7000 ft"],
    ),
    "no rotary gust": (
        {"aircraft": "c172x", "gust": {"level": "light", "rotary": True}},
        ["gust.rotary", "c172x has no rotary_gust"],
    ),
    "no augmentation": (
        {"aircraft": "c172x", "augmentation": {"damper_gain_s": 0.1}},
        ["augmentation", "c172x has no [jsbsim.augmentation]"],
    ),
}


@pytest.mark.grid
@pytest.mark.parametrize("case", BAD)
def test_message_and_exit_code(tmp_path, case):
    changes, words = BAD[case]
    file = write(tmp_path / "campaign.toml", **changes)
    ended = command("fly", file, "--out", tmp_path / "out")
    assert ended.code == 2, ended
    assert ended.err.startswith("airtruth: ")
    for word in words:
        assert word in ended.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "case", ["misspelt key", "untrimmable", "edge off the grid", "gust altitude", "negative noise"]
)
def test_message_names_the_file(tmp_path, case):
    file = write(tmp_path / "campaign.toml", **BAD[case][0])
    assert str(file) in command("fly", file, "--out", tmp_path / "out").err


def test_all_problems_of_a_file_at_once(tmp_path):
    file = write(
        tmp_path / "c.toml",
        runs=0,
        durations_s=1.0,
        gust={"level": "ligth"},
        condition={"eas_ft": 1.0, "altitude_ft": 0.0},
    )
    said = command("fly", file, "--out", tmp_path / "out").err
    for word in ("runs", "durations_s", "ligth", "eas_ft"):
        assert word in said


def test_all_problems_of_a_plan_at_once(tmp_path):
    manoeuvres = [
        DOUBLET | {"start_s": 0.503},
        DOUBLET | {"amplitude_deg": 25.0},
        DOUBLET | {"start_s": 1.75},
    ]
    said = command("fly", write(tmp_path / "c.toml", manoeuvre=manoeuvres), "--out", tmp_path / "out").err
    assert "3 problem(s)" in said
    for word in (
        "manoeuvre.0: the manoeuvre has an edge",
        "manoeuvre.1: the command reaches",
        "manoeuvre.2: it ends",
    ):
        assert word in said


@pytest.mark.slow
def test_saturation_is_flown_when_asked_for(tmp_path):
    hard = [DOUBLET | {"amplitude_deg": 25.0, "saturate": True}]
    out = fly(tmp_path, runs=1, gust=None, manoeuvre=hard, sensors={"ideal": True})
    elevator = channel(out, "elevator_rad")
    assert np.rad2deg(elevator.max()) == pytest.approx(20.0, abs=1e-4)  # aircraft.toml, the servo's limit


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("eas = = 3", ["not valid TOML", "line 1"]),
        ("\xff\xfe", ["cannot be read"]),
        (None, ["no such campaign file", "airtruth new campaign"]),
    ],
)
def test_files_that_are_no_campaign(tmp_path, content, words):
    file = tmp_path / "campaign.toml"
    if content is not None:
        file.write_bytes(content.encode("latin-1"))
    ended = command("fly", file, "--out", tmp_path / "out")
    assert ended.code == 2
    for word in (str(file), *words):
        assert word in ended.err


@pytest.mark.slow
def test_replayed_log_that_is_missing_or_lacks_the_run(tmp_path):
    log = fly(tmp_path / "a", runs=1) / "logs" / "00000.parquet"
    for entry, words in (
        ({"file": "nowhere.parquet"}, ["nowhere.parquet"]),
        ({"file": log, "run_id": "small-000009"}, ["no run 'small-000009'", "small-000000"]),
    ):
        file = write(tmp_path / "c.toml", manoeuvre=[{"kind": "replay", "start_s": 0.0} | entry])
        ended = command("fly", file, "--out", tmp_path / "out")
        assert ended.code == 2
        for word in words:
            assert word in ended.err


@pytest.mark.parametrize(
    "changes",
    [
        {"condition": LEVEL | {"eas_kt": -75.0}},
        {"gust": GUST | {"factor": -1.0}},
        {"condition": LEVEL | {"eas_kt": {"low": 80.0, "high": 70.0}}},
    ],
    ids=["negative airspeed", "negative gust factor", "low above high"],
)
def test_values_without_meaning_are_refused(tmp_path, changes):
    file = write(tmp_path / "c.toml", runs=1, **changes)
    assert command("fly", file, "--out", tmp_path / "out", "--dry-run").code == 2
