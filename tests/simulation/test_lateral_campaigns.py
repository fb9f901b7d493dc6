"""Campaigns that roll and yaw: files, draws, columns, signs, and that those in the pitch plane do not change."""

import json
import os
import shutil
import signal
import time

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from commands import running
from fly_campaigns import channel, command, fly, read, results, runs_recorded, write
from test_log_contract import COLUMNS

from airtruth.channels import LATERAL
from airtruth.errors import ConfigurationError
from airtruth.physics import lateral_gusts, motion
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.simulation.campaign.air import air_of
from airtruth.simulation.campaign.write import as_toml
from airtruth.starting.examples import data_root
from airtruth.units import DEG

AILERON = {"control": "aileron", "kind": "121", "amplitude_deg": 3.0, "start_s": 0.5, "step_s": 0.2}
RUDDER = {"control": "rudder", "kind": "3211", "amplitude_deg": 3.0, "start_s": 1.5, "step_s": 0.1}
BOTH = AILERON | {"also": [RUDDER]}
FLOAT32 = 2e-7
"""Rounding of a few readings of a log [rad], [rad/s]: angles of some degrees have 24 bits."""
CALM = {"gust": None, "sensors": {"ideal": True}, "runs": 1, "duration_s": 2.5}
MIXED = {
    "runs": 5,
    "duration_s": 2.5,
    "condition": {"eas_kt": {"low": 70.0, "high": 80.0}, "altitude_ft": 6000.0},
    "gust": {"level": "moderate", "factor": {"choose": [0.5, 1.0]}, "rotary": True},
    "augmentation": {"yaw_damper_gain_s": 0.1, "yaw_damper_washout_s": 2.0, "bank_gain": 0.1},
    "manoeuvre": [
        AILERON
        | {
            "amplitude_deg": {"choose": [-3.0, 3.0]},
            "also": [RUDDER | {"amplitude_deg": {"low": 2.0, "high": 3.0}}],
        },
        {"kind": "pulse", "amplitude_deg": -1.0, "start_s": 0.5, "step_s": 0.25},
    ],
}


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("mixed"), **MIXED)


@pytest.fixture(scope="module")
def calm(tmp_path_factory):
    return read(fly(tmp_path_factory.mktemp("calm"), manoeuvre=[BOTH], **CALM))


def test_a_pitch_plane_campaign_parses_to_the_same_plan(tmp_path):
    """The columns and the inputs of a campaign that names no control are those of one that names the elevator."""
    plain = plan.make(write(tmp_path / "plain.toml"))
    shape = {"kind": "doublet", "amplitude_deg": 2.0, "start_s": 0.5, "step_s": 0.25}
    named = plan.make(write(tmp_path / "named.toml", manoeuvre=[shape | {"control": "elevator"}]))
    assert plain.table.equals(named.table)
    assert plain.digest == named.digest
    assert not plain.campaign.lateral
    assert list(plain.table.columns) == [
        "run", "run_id", "chunk", "eas_m_s", "altitude_m", "gamma_rad", "wind_m_s", "manoeuvre",
        "amplitude_rad", "sigma_u_m_s", "sigma_w_m_s", "length_u_m", "length_w_m",
    ]  # fmt: skip


def test_a_pitch_plane_log_has_no_lateral_column(tmp_path):
    out = fly(tmp_path, runs=1)
    assert list(read(out).columns) == COLUMNS
    assert not {"CYbeta", "sigma_v_m_s", "trim_beta_rad"} & set(
        pd.read_parquet(out / "truth.parquet").columns
    )


def test_side_gusts_leave_the_gusts_of_the_pitch_plane(tmp_path):
    """u, w and q have the same bits with and without side gusts, which have a random stream of their own."""
    duration = {"duration_s": 2.5, "manoeuvre": [BOTH]}
    with_side = plan.make(write(tmp_path / "a.toml", gust={"level": "light", "rotary": True}, **duration))
    without = plan.make(
        write(tmp_path / "b.toml", gust={"level": "light", "rotary": True, "lateral": False}, **duration)
    )
    assert "sigma_v_m_s" not in without.table
    for one, two in zip(plan.planned_runs(with_side.table), plan.planned_runs(without.table), strict=True):
        side, none = air_of(with_side, one, 42.85), air_of(without, two, 42.85)
        for name in ("u_m_s", "w_m_s"):
            np.testing.assert_array_equal(getattr(side, name), getattr(none, name))
        np.testing.assert_array_equal(*(air.rotation_rad_s["q_rad_s"] for air in (side, none)))
        turning = side.rotation_of(motion.LATERAL)
        assert none.v_m_s is None
        assert not none.rotation_of(motion.LATERAL)
        assert len({float(x[7]) for x in (side.v_m_s, side.w_m_s, *turning.values())}) == 4


def test_the_levels_of_the_side_gusts_are_those_of_the_plan(tmp_path):
    """Standard deviations over 3,000 runs at one sample, within 4 standard errors: v of the plan, p of the specification."""
    row = AILERON | {"start_s": 0.1, "step_s": 0.01}
    file = write(
        tmp_path / "campaign.toml",
        runs=3000,
        duration_s=0.2,
        manoeuvre=[row],
        gust={"level": "moderate", "rotary": True},
    )
    made = plan.make(file)
    runs = plan.planned_runs(made.table)
    drawn = np.array(
        [
            [h[20] for h in (air.v_m_s, air.rotation_rad_s["p_rad_s"])]
            for air in (air_of(made, run, 42.85) for run in runs)
        ]
    )
    sigma_w = made.table["sigma_w_m_s"].iloc[0]
    sigma_p = lateral_gusts.roll_deviation_rad_s(sigma_w, made.table["length_w_m"].iloc[0], 2.08751)
    np.testing.assert_allclose(
        np.sqrt(np.mean(drawn**2, axis=0)), [sigma_w, sigma_p], rtol=4 / np.sqrt(2 * 3000)
    )


def test_log_plan_and_truth_have_the_lateral_columns(mixed):
    assert list(read(mixed).columns) == [*COLUMNS, *LATERAL]
    assert not read(mixed).isna().to_numpy().any()
    table = pd.read_parquet(mixed / "plan.parquet")
    first = table["manoeuvre"] == 0
    assert set(np.round(table.loc[first, "amplitude_rad"] / DEG, 9)) <= {-3.0, 3.0}
    assert table.loc[first, "amplitude_2_rad"].between(2.0 * DEG, 3.0 * DEG).all()
    assert table.loc[~first, "amplitude_2_rad"].isna().all()
    np.testing.assert_array_equal(table["sigma_v_m_s"], table["sigma_w_m_s"])
    truth = pd.read_parquet(mixed / "truth.parquet")
    names = {
        *motion.LATERAL.parameters,
        *motion.LATERAL.modal,
        "trim_beta_rad",
        "trim_aileron_rad",
        "sigma_v_m_s",
    }
    assert not truth[sorted(names)].isna().to_numpy().any()


def test_the_result_shows_both_motions(mixed):
    figure = campaign.fly(plan.make(mixed.parent / "campaign.toml"), mixed).plot()
    shown = [ax.get_ylabel() for ax in figure.axes if ax.axison]
    assert shown == [
        "elevator [rad]", "alpha [rad]", "q [rad/s]", "az [m/s2]", "aileron [rad]", "rudder [rad]", "beta [rad]",
        "p [rad/s]", "r [rad/s]", "phi [rad]", "ay [m/s2]",
    ]  # fmt: skip


def test_a_log_states_nothing_of_gusts_or_truth(mixed):
    for path in sorted((mixed / "logs").iterdir()):
        said = json.loads(pq.read_schema(path).metadata[b"airtruth"])
        assert said == {"schema": 1, "aircraft": "gtm", "sample_rate_hz": 50}


@pytest.mark.slow
def test_two_processes_write_the_bytes_of_one(mixed, tmp_path):
    assert results(fly(tmp_path, jobs=2, **MIXED)) == results(mixed)


def test_signs_of_the_controls(calm):
    """Contract of the channels: an aileron (right - left)/2, trailing edge down on the right, rolls to the left; a rudder with
    the trailing edge left pushes the tail to the right and yaws to the left."""
    first = calm.iloc[0]
    rolling = calm[(calm["t_s"] > 0.59) & (calm["t_s"] < 0.7)]
    assert (rolling["aileron_rad"] > first["aileron_rad"] + 1.0 * DEG).all()
    assert (rolling["p_rad_s"] < -5.0 * DEG).all()
    pushed = calm[np.isclose(calm["t_s"], 1.56)]
    assert pushed["rudder_rad"].item() > first["rudder_rad"] + 1.0 * DEG
    before = calm[np.isclose(calm["t_s"], 1.5)]
    assert pushed["r_rad_s"].item() < before["r_rad_s"].item()
    assert pushed["ay_m_s2"].item() > before["ay_m_s2"].item()


def test_commands_are_the_inputs_about_the_trim(calm):
    """Unit shapes by hand: aileron 1-2-1 of .2 s from .5 s, rudder 3-2-1-1 of .1 s from 1.5 s."""
    at = {
        "aileron": {0.6: 3.0, 0.8: -3.0, 1.2: 3.0, 1.4: 0.0},
        "rudder": {1.6: 3.0, 1.9: -3.0, 2.04: 3.0, 2.14: -3.0, 2.3: 0.0},
    }
    for control, values in at.items():
        moved = calm[f"{control}_command_rad"] - calm[f"{control}_command_rad"].iloc[0]
        for t, degrees in values.items():
            assert moved[np.isclose(calm["t_s"], t)].item() == pytest.approx(degrees * DEG, abs=FLOAT32)
    assert calm["elevator_command_rad"].nunique() == 1


@pytest.mark.slow
def test_without_an_input_the_trim_is_kept(tmp_path):
    """Wings level with sideslip, and without sideslip and with bank: no channel moves in two seconds."""
    still = AILERON | {"amplitude_deg": 0.0}
    for straight, zero in (("wings-level", "phi_rad"), ("no-sideslip", "beta_rad")):
        condition = {"eas_kt": 75.0, "altitude_ft": 7000.0, "straight": straight}
        log = read(fly(tmp_path / straight, manoeuvre=[still], condition=condition, **CALM))
        assert abs(log[zero].iloc[0]) < 1e-9
        for name in LATERAL:
            assert np.ptp(log[name]) < 1e-7


@pytest.mark.slow
def test_yaw_damper_and_bank_hold(tmp_path):
    """The commands of the log are the pilot's, as with the pitch damper; the bank returns and the Dutch roll is damped."""
    gains = {"yaw_damper_gain_s": 0.2, "bank_gain": 0.3, "roll_damper_gain_s": 0.05}
    held = read(fly(tmp_path / "on", manoeuvre=[BOTH], augmentation=gains, **CALM | {"duration_s": 6.0}))
    free = read(fly(tmp_path / "off", manoeuvre=[BOTH], **CALM | {"duration_s": 6.0}))
    for control in ("aileron", "rudder"):
        np.testing.assert_array_equal(held[f"{control}_command_rad"], free[f"{control}_command_rad"])
    late = held["t_s"] > 4.0
    assert np.abs(held.loc[late, "phi_rad"]).max() < 0.3 * np.abs(free.loc[late, "phi_rad"]).max()
    assert np.ptp(held.loc[late, "beta_rad"]) < 0.5 * np.ptp(free.loc[late, "beta_rad"])


@pytest.mark.slow
@pytest.mark.parametrize("sensors", [{"ideal": True}, None], ids=["ideal", "noisy"])
def test_the_surface_answers_to_the_feedback_of_the_logged_readings(tmp_path, sensors):
    """Surface = servo and 15 ms of delay of command + gain x reading, held over a sample of the log.

    An independent servo: exponential lag of 5 Hz from step to step. A command that changes after the sample acts from the next
    step on, and inside the loop the delay is a frame shorter (aircraft/gtm/README.md).
    """
    row = AILERON | {"amplitude_deg": 1.0}
    gain, dt = 0.2, 0.005
    options = CALM | {"sensors": sensors, "log_hz": 200.0}
    log = read(fly(tmp_path, manoeuvre=[row], augmentation={"yaw_damper_gain_s": gain}, **options))
    r = log["r_rad_s"].to_numpy(dtype=float)
    fed = gain * r
    demand = np.concatenate(
        [np.zeros(1), fed[:-1]]
    )  # the feedback of a sample is sent with the following step
    late = np.concatenate([np.zeros(2), demand[:-2]])
    surface, keep = np.zeros(len(r)), np.exp(-dt * 2.0 * np.pi * 5.0)
    for k in range(1, len(r)):
        surface[k] = keep * surface[k - 1] + (1.0 - keep) * 0.5 * (late[k] + late[k - 1])
    found = log["rudder_rad"].to_numpy(dtype=float)
    noise = 0.0 if sensors else 0.01 * DEG
    assert np.abs(found - found[0] - surface).max() < 0.03 * np.ptp(found) + 5.0 * noise


@pytest.mark.slow
def test_killed_and_resumed_the_bytes_are_the_same(tmp_path):
    """SIGKILL to the command and its two processes once runs are recorded; the same command flies the rest."""
    rows = MIXED | {"runs": 60, "duration_s": 5.0}
    file = write(tmp_path / "campaign.toml", **rows)
    with running("fly", file, "--out", tmp_path / "out", "--jobs", 2, "--quiet") as process:
        end = time.monotonic() + 60.0
        while len(runs_recorded(tmp_path / "out")) < 10 and process.poll() is None:
            assert time.monotonic() < end
            time.sleep(0.002)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert 10 <= len(runs_recorded(tmp_path / "out")) < 60
    assert command("fly", file, "--out", tmp_path / "out", "--jobs", 1).code == 0
    assert results(tmp_path / "out") == results(fly(tmp_path / "whole", **rows))


@pytest.mark.slow
def test_a_sensor_with_a_lag_reads_every_step_and_the_flight_is_the_same(tmp_path):
    lagged = {"channel": {"beta_rad": {"lag": {"value": 30.0, "unit": "ms"}}}}
    gains = {"yaw_damper_gain_s": 0.2}
    rows = CALM | {"manoeuvre": [BOTH], "augmentation": gains}
    plain, seen = (
        read(fly(tmp_path / name, **rows | {"sensors": sensors}))
        for name, sensors in (("plain", None), ("lagged", lagged))
    )
    for name in ("p_rad_s", "rudder_command_rad", "psi_rad"):
        np.testing.assert_array_equal(plain[name], seen[name])
    assert not np.array_equal(plain["beta_rad"], seen["beta_rad"])


@pytest.mark.slow
@pytest.mark.parametrize("what", ["command", "surface"])
def test_a_lateral_log_is_replayed(tmp_path, what):
    """Commands, or surfaces past the actuators, of a flight with ideal sensors: the motion comes again."""
    flown = fly(tmp_path / "flown", manoeuvre=[BOTH], simulation_hz=200.0, log_hz=200.0, **CALM)
    (log,) = (flown / "logs").iterdir()
    ending = "command_rad" if what == "command" else "rad"
    rows = [
        {"control": c, "kind": "replay", "file": str(log), "channel": f"{c}_{ending}", "start_s": 0.0}
        for c in ("aileron", "rudder")
    ]
    again = fly(tmp_path / "again", manoeuvre=[rows[0] | {"also": rows[1:]}], log_hz=200.0, **CALM)
    scale = np.abs(channel(flown, "p_rad_s")).max()
    # the log rounds to 24 bits; a surface is known at the samples alone, and moves in a step to the next
    tolerance = 1e-6 if what == "command" else 0.02
    assert np.abs(channel(again, "p_rad_s") - channel(flown, "p_rad_s")).max() < tolerance * scale


BAD = {
    "a control that does not exist": (
        {"manoeuvre": [AILERON | {"control": "ailron"}]},
        "manoeuvre.0.control: 'ailron' is not known; did you mean 'aileron'",
    ),
    "a further input without amplitude": (
        {"manoeuvre": [AILERON | {"also": [{"control": "rudder", "kind": "3211"}]}]},
        "manoeuvre.0.also.0: amplitude is missing: without it the rudder stays at its trim",
    ),
    "a replay of another control's channel": (
        {"manoeuvre": [{"control": "rudder", "kind": "replay", "file": "x.parquet", "channel": "aileron_rad"}]},
        "channel = 'aileron_rad' does not move the rudder; allowed: rudder_command_rad, rudder_rad",
    ),
    "a surface beside a command": (
        {"manoeuvre": [AILERON | {"also": [{"control": "rudder", "kind": "replay", "file": "x", "channel": "rudder_rad"}]}]},
        "a replay of a surface goes past all actuators",
    ),
    "an input beyond the actuator": (
        {"manoeuvre": [AILERON | {"amplitude_deg": 45.0}]},
        r"manoeuvre.0: the aileron command reaches -44.9 to 45.1 deg with the trim's 0.1 deg; allowed -30 to 30 deg",
    ),
    "a further input that ends too late": (
        {"manoeuvre": [AILERON | {"also": [RUDDER | {"start_s": 1.8}]}]},
        r"manoeuvre.0.also.0: it ends at 2.5 s, after the run of 2 s",
    ),
    "two inputs of one control that reach its limit together": (
        {"manoeuvre": [AILERON | {"amplitude_deg": 20.0, "also": [AILERON | {"amplitude_deg": 20.0}], "saturate": False}]},
        r"the aileron command reaches -39.9 to 40.1 deg",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_campaigns_are_refused_with_the_place(tmp_path, case):
    changes, message = BAD[case]
    with pytest.raises(ConfigurationError, match=message.replace("(", r"\(")):
        plan.make(write(tmp_path / "campaign.toml", **changes))


def test_an_aircraft_without_lateral_controls_is_refused(tmp_path):
    folder = shutil.copytree(data_root().parent / "aircraft" / "gtm", tmp_path / "plane")
    file = folder / "aircraft.toml"
    before, _, rest = file.read_text().partition("[jsbsim.rudder]")
    file.write_text(before + rest[rest.index("[jsbsim.") :])
    campaign_path = write(tmp_path / "campaign.toml", aircraft=str(folder), manoeuvre=[AILERON])
    ended = command("fly", campaign_path, "--out", tmp_path / "out", "--dry-run")
    assert ended.code == 2
    assert "manoeuvre.control: gtm has no [jsbsim.rudder] in its aircraft.toml" in ended.err


def test_a_lateral_campaign_is_written_and_read_again(tmp_path):
    made = campaign_file.read(write(tmp_path / "campaign.toml", **MIXED))
    (tmp_path / "again.toml").write_text(as_toml(made), encoding="utf-8")
    assert campaign_file.read(tmp_path / "again.toml") == made
