"""The gate names every physical fault of the table, and lets every faultless flight through."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from clean_logs import RATES_HZ, fly, picked, table
from faults import FAULTS
from tiers import sampled

from airtruth import aircraft as planes
from airtruth.checks.columns import dropouts, spikes
from airtruth.checks.corrections import catalogue
from airtruth.checks.fault import CODES
from airtruth.checks.gate import admit, inspect
from airtruth.checks.together import Runs
from airtruth.errors import LogError
from airtruth.logs.flight_log import batches
from airtruth.logs.store import read_log, write_log
from airtruth.units import G0

ROOT = Path(__file__).resolve().parents[2]
UNDECLARED = sorted((ROOT / "data" / "undeclared").glob("*.parquet"))
NEEDS_AIRCRAFT = {"airspeed in kt", "airspeed times 0.2", "command in place of elevator"}
"""Faults that kinematics alone does not show in six gusty records: they need the declared aircraft."""


@pytest.fixture(scope="module")
def log():
    return read_log(UNDECLARED[0])


def certain(faults):
    return [fault for fault in faults if fault.certain]


@pytest.mark.slow
@pytest.mark.parametrize("name", sampled(FAULTS, 3))
def test_every_fault_is_named(name, log, gtm):
    fault = certain(inspect(FAULTS[name](log), gtm))[0]
    assert fault.channel in FAULTS[name].channels
    assert fault.code in FAULTS[name].codes
    assert fault.code in CODES
    assert fault.channel in fault.sentence
    assert "\n" not in fault.sentence


@pytest.mark.slow
@pytest.mark.parametrize("name", sampled((name for name in FAULTS if name not in NEEDS_AIRCRAFT), 5))
def test_every_fault_is_named_without_an_aircraft(name, log):
    fault = certain(inspect(FAULTS[name](log)))[0]
    assert fault.channel in FAULTS[name].channels
    assert fault.code in FAULTS[name].codes


D = 180.0 / np.pi
ANGLES = ("alpha_rad", "theta_rad", "elevator_rad", "elevator_command_rad")
PITCH = ("alpha_rad", "theta_rad", "q_rad_s")
SURFACE = ("elevator_rad", "elevator_command_rad")
SHARED = {
    "surface and command, trailing edge up positive": (dict.fromkeys(SURFACE, -1.0), "sign"),
    "nose down positive": (dict.fromkeys(PITCH, -1.0), "sign"),
    "all angles and rates in degrees": (dict.fromkeys((*ANGLES, "q_rad_s"), D), "unit"),
    "all angles in degrees": (dict.fromkeys(ANGLES, D), "unit"),
    "motion in degrees": (dict.fromkeys(PITCH, D), "unit"),
    "surface and command in degrees": (dict.fromkeys(SURFACE, D), "unit"),
    "accelerations in g": (dict.fromkeys(("az_m_s2", "ax_m_s2"), 1.0 / G0), "unit"),
    "accelerations of opposite sign": (dict.fromkeys(("az_m_s2", "ax_m_s2"), -1.0), "sign"),
}
"""Mistakes that several channels share: factor of each channel, and the kind."""


@pytest.mark.slow
@pytest.mark.parametrize("path", sampled(UNDECLARED[:4], 4), ids=lambda path: path.stem)
@pytest.mark.parametrize("mistake", SHARED)
def test_a_mistake_that_channels_share_is_named_for_each(mistake, path, gtm):
    """Such logs were refused with a wrong cause, for example exchanged columns."""
    factors, code = SHARED[mistake]
    log = read_log(path)
    channels = {n: factors.get(n, 1.0) * x for n, x in log.channels.items()}
    faults = certain(inspect(replace(log, channels=channels), gtm))
    assert {(f.channel, f.code) for f in faults} == {(name, code) for name in factors}
    for fault in faults:
        others = set(factors) - {fault.channel}
        assert all(name in fault.sentence.split(" in all ")[0] for name in others)
        assert f"under [channels.{fault.channel}]" in fault.sentence


@pytest.mark.slow
def test_a_shared_unit_and_a_shared_sign_are_both_named(log, gtm):
    """Everything in degrees, and the surface positive with its trailing edge up."""
    factors = dict.fromkeys((*ANGLES, "q_rad_s"), D) | dict.fromkeys(SURFACE, -D)
    channels = {n: factors.get(n, 1.0) * x for n, x in log.channels.items()}
    faults = certain(inspect(replace(log, channels=channels), gtm))
    expected = {(name, "unit") for name in factors} | {(name, "sign") for name in SURFACE}
    assert {(f.channel, f.code) for f in faults} == expected


def test_outliers_are_no_wrong_unit(log, gtm):
    """One sample in 97 of 20 rad/s, as errors of telemetry are; it was called a gyro in deg/s."""
    x = log.channels["q_rad_s"].copy()
    x[::97] = 20.0
    (fault,) = certain(inspect(replace(log, channels={**log.channels, "q_rad_s": x}), gtm))
    assert (fault.channel, fault.code) == ("q_rad_s", "spike")
    assert f"isolated outliers in {len(x[::97])} samples of all 6 runs" in fault.sentence


def test_a_short_peak_of_the_motion_is_no_outlier():
    """Three samples of a coarse record at rest are a peak, two of twice the size are an outlier."""
    x = np.zeros((1, 64))
    x[0, 30:33] = 0.5
    assert list(spikes(SimpleNamespace(channels={"q_rad_s": x}, dt_s=0.02))) == []
    x[0, 10:12] = 1.2
    ((name, bad, count),) = spikes(SimpleNamespace(channels={"q_rad_s": x}, dt_s=0.02))
    assert (name, bad.tolist(), count) == ("q_rad_s", [True], 2)
    assert list(spikes(SimpleNamespace(channels={"q_rad_s": x}, dt_s=0.1))) == []


def test_a_fast_oscillation_is_no_outlier():
    """A mode of 5 Hz at 25 Hz: the median of its neighbours removes it."""
    x = np.sin(2.0 * np.pi * 5.0 * 0.04 * np.arange(100))[None]
    assert list(spikes(SimpleNamespace(channels={"q_rad_s": x}, dt_s=0.04))) == []


@pytest.mark.slow
def test_a_late_vane_and_a_wrong_airspeed_that_fit_alike_are_both_named(log):
    """Kinematics alone cannot tell a vane that is 0.8 s late from a fifth of the airspeed in these gusts."""
    fault = next(f for f in inspect(FAULTS["airspeed times 0.2"](log)) if f.code == "lag")
    assert not fault.certain
    assert "possibly about 0.8 s late, or airspeed_m_s: factor of about 0.2 in all 6 runs" in fault.sentence
    assert "state the unit and scale of airspeed_m_s in the import mapping" in fault.sentence


HIDDEN = {"ax in g", "theta frozen", "elevator and command", "command in place of elevator"}
"""Faults that this flight does not show: ax changes little, theta rests where it is frozen, and the T-38 has no
actuator, so that elevator and command agree but for noise."""


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    flight = next(
        f for f in table() if (f.aircraft, f.level, f.manoeuvre, f.noisy) == ("T38", "none", "3211", True)
    )
    return fly(flight, tmp_path_factory.mktemp("T38"))


@pytest.mark.slow
@pytest.mark.parametrize("name", sampled((name for name in FAULTS if name not in HIDDEN), 5))
def test_every_fault_of_a_simulated_record_is_named(name, simulated):
    fault = certain(inspect(FAULTS[name](simulated), planes.load("T38")))[0]
    assert fault.channel in FAULTS[name].channels
    assert fault.code in FAULTS[name].codes


@pytest.mark.parametrize("path", UNDECLARED, ids=lambda path: path.stem)
def test_logs_with_undeclared_effects_pass(path, gtm):
    """A missing effect is what `trace` looks for, and no fault of the log."""
    assert certain(inspect(read_log(path), gtm)) == []
    assert certain(inspect(read_log(path))) == []


FEW = {("gtm", "severe", True)}
"""Aircraft, gust level and noise of the flights that the fast suite flies."""


def check_clean(flight, folder):
    declared = planes.load(flight.aircraft)
    flown = fly(flight, folder)
    for rate_hz in RATES_HZ:
        for aircraft in (declared, None):
            assert certain(inspect(picked(flown, rate_hz), aircraft)) == [], (flight.name, rate_hz)


@pytest.mark.slow
@pytest.mark.parametrize(
    "flight",
    [f for f in table() if f.manoeuvre == "3211" and (f.aircraft, f.level, f.noisy) in FEW],
    ids=lambda flight: flight.name,
)
def test_clean_flights_pass(flight, tmp_path):
    check_clean(flight, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "flight", sampled((f for f in table() if f.noisy), 8), ids=lambda flight: flight.name
)
def test_all_clean_flights_pass(flight, tmp_path):
    """48 flights with much noise at five rates: 240 logs."""
    check_clean(flight, tmp_path)


@pytest.mark.study
@pytest.mark.parametrize("flight", [f for f in table() if not f.noisy], ids=lambda flight: flight.name)
def test_all_clean_flights_with_their_own_sensors_pass(flight, tmp_path):
    """48 further flights at five rates: 240 logs."""
    check_clean(flight, tmp_path)


def test_a_fault_of_one_run_names_that_run(log):
    q = log.channels["q_rad_s"].copy()
    rows = log.rows(2)
    q[rows] = -q[rows]
    fault = certain(inspect(replace(log, channels={**log.channels, "q_rad_s": q})))[0]
    assert (fault.channel, fault.code, fault.run_id) == ("q_rad_s", "sign", log.run_ids[2])
    assert f"in 1 of 6 runs ({log.run_ids[2]!r})" in fault.sentence


@pytest.mark.slow
def test_two_faults_are_both_named(log, gtm):
    changed = {n: v / np.deg2rad(1.0) for n, v in log.channels.items() if n in ("alpha_rad", "theta_rad")}
    faults = certain(inspect(replace(log, channels={**log.channels, **changed}), gtm))
    assert {(f.channel, f.code) for f in faults} == {("alpha_rad", "unit"), ("theta_rad", "unit")}


def test_a_fault_raises_one_sentence_with_the_cure(log):
    bad = FAULTS["az sign"](log)
    with pytest.raises(
        LogError, match=r"^flight-7: contradicts physics; correct it, or .* --force\n"
    ) as caught:
        admit(bad, source="flight-7")
    line = str(caught.value).splitlines()[1]
    assert line.startswith("  - az_m_s2: opposite sign in all 6 runs: ")
    assert line.endswith("; state sign = -1 under [channels.az_m_s2] in the import mapping")


def test_force_returns_the_faults(log):
    assert [f.channel for f in admit(FAULTS["az sign"](log), force=True).faults] == ["az_m_s2"]


def test_a_breach_of_the_contract_cannot_be_forced(log):
    with pytest.raises(LogError, match="q_rad_s: required channel is missing"):
        admit(replace(log, channels={n: v for n, v in log.channels.items() if n != "q_rad_s"}), force=True)


@pytest.mark.parametrize(
    ("column", "channel"),
    [
        ("elevator_comand_rad", "elevator_command_rad"),
        ("elevator_cmd_rad", "elevator_command_rad"),
        ("Theta_rad", "theta_rad"),
        ("theta_deg", "theta_rad"),
        ("ax", "ax_m_s2"),
        ("ax_g", "ax_m_s2"),
        ("throtle", "throttle"),
        ("altitude_ft", "altitude_m"),
        ("density_kgm3", "density_kg_m3"),
    ],
)
def test_a_misspelt_column_names_the_nearest_channel(log, column, channel):
    channels = {n: v for n, v in log.channels.items() if n != channel}
    faults = certain(inspect(replace(log, channels={**channels, column: log.channels[channel]})))
    assert [(f.channel, f.code) for f in faults] == [(channel, "name")]
    assert faults[0].sentence.startswith(f"{column}: no channel has this name")
    assert f"rename it to {channel}" in faults[0].sentence


@pytest.mark.parametrize("column", ["ay_m_s2", "p_rad_s", "flap_rad", "vcas", "alpha_vane_rad"])
def test_other_columns_are_left_alone(log, column):
    channels = {n: v for n, v in log.channels.items() if n not in ("ax_m_s2", "theta_rad")}
    assert certain(inspect(replace(log, channels={**channels, column: log.channels["ax_m_s2"]}))) == []


def restated(path, name, unit):
    """The file with another unit in the metadata of a column."""
    import pyarrow.parquet as pq

    schema_table = pq.read_table(path)
    schema = schema_table.schema
    at = schema.get_field_index(name)
    schema = schema.set(at, schema.field(at).with_metadata({"unit": unit}))
    pq.write_table(schema_table.cast(schema).replace_schema_metadata(schema_table.schema.metadata), path)


@pytest.mark.parametrize(
    ("unit", "refused"), [("deg", True), ("m/s", True), ("radian", False), ("foo", False)]
)
def test_unit_metadata_that_contradict_the_name(log, tmp_path, unit, refused):
    path = tmp_path / "log.parquet"
    write_log(path, log)
    restated(path, "alpha_rad", unit)
    faults = certain(inspect(read_log(path)))
    assert [(f.channel, f.code) for f in faults] == ([("alpha_rad", "metadata")] if refused else [])
    if refused:
        assert f"state the unit {unit}, the column's name states rad" in faults[0].sentence


def test_a_copy_is_told_from_an_actuator_that_is_not_declared(log, gtm):
    """Elevator and command agree exactly in a simulation without an actuator; the GTM declares one of 5 Hz."""
    same = FAULTS["command in place of elevator"](log)
    assert certain(inspect(same)) == []
    assert [(f.channel, f.code) for f in certain(inspect(same, gtm))] == [("elevator_rad", "copy")]


def test_every_correction_has_words_of_its_own(log):
    """Two mistakes with the same words and cure could not be told apart by a reader."""
    entries = [(c.channels, c.mistake, c.cure) for c in catalogue(Runs(tuple(batches(log))))]
    assert len(set(entries)) == len(entries)
    assert {c.code for c in catalogue(Runs(tuple(batches(log))))} <= set(CODES)


def test_a_record_at_rest_has_no_fault(log):
    still = {name: np.full_like(values, values[0]) for name, values in log.channels.items()}
    assert inspect(replace(log, channels=still)) == ()


@pytest.mark.slow
def test_damaged_aircraft_are_not_refused(tmp_path, gtm):
    """An aircraft that lost its tail departs and stalls; a quantised accelerometer repeats its values.

    Each of these flights of the blind trials was once refused; `python -m studies.gate_refusals` flies 600.
    """
    from validation.blind import draw, trials

    once = [("composite", n) for n in (23, 54, 71, 81, 97)] + [("derivative", 297)]
    folders = [tmp_path / f"{mode}-{number}" for mode, number in once]
    trials.flown_apart([draw.draw(51501, number, mode) for mode, number in once], folders)
    for folder in folders:
        log = read_log(folder / "log.parquet")
        assert certain(inspect(log, gtm)) == [], folder.name
        assert certain(inspect(log)) == [], folder.name


QUANTISED = [0.3, -0.3, 0.0, 12.3, 0.0, -15.0, -24.6, -9.9, 0.0, 0.3, 0.0, 0.0, -0.3, 0.3, 0.0, 0.6]
"""A coarse gyro of 0.3 deg/s in a doublet [deg/s]: it passes zero on the way from 12 to -15, and rests at zero."""


def test_a_coarse_sample_of_zero_between_two_signs_is_no_dropout():
    channels = {"q_rad_s": np.tile(np.deg2rad(QUANTISED), (1, 4))}
    assert list(dropouts(SimpleNamespace(channels=channels))) == []


def test_a_sample_of_zero_that_comes_back_is_a_dropout():
    x = np.deg2rad(np.tile(QUANTISED, (1, 4)))
    x[:, 6::16] = 0.0
    ((name, bad, count),) = dropouts(SimpleNamespace(channels={"q_rad_s": x}))
    assert (name, bad.tolist(), count) == ("q_rad_s", [True], int((x == 0.0).sum()))


@pytest.mark.slow
def test_a_surface_that_moves_nothing_is_no_wrong_unit(log, gtm):
    """Doublets of 2 deg beside motion of gusts alone: in degrees they would be 0.03 deg."""
    pulse = np.where((log.t_s > 1.0) & (log.t_s < 3.0), np.sign(2.0 - log.t_s), 0.0) * np.radians(2.0)
    for names in (("elevator_rad",), ("elevator_rad", "elevator_command_rad")):
        channels = {
            n: x for n, x in log.channels.items() if n not in ("elevator_rad", "elevator_command_rad")
        }
        channels |= {n: pulse + log.channels[n].mean() for n in names}
        found = inspect(replace(log, channels=channels), gtm)
        assert [f for f in found if f.certain and "degrees" in f.sentence] == []


def test_a_run_that_repeats_another_is_named(log, gtm):
    both = type(log).concat([log, replace(log, run_ids=tuple(f"{r}-again" for r in log.run_ids))])
    (fault,) = (f for f in inspect(both, gtm) if f.channel == "run_id")
    assert (fault.code, fault.certain) == ("copy", False)
    assert "has the samples of run" in fault.sentence
    assert "5 further runs repeat others" in fault.sentence
