"""NASA Twin Otter, SIDPAC example records, against the printed results (V. Klein and E. A. Morelli,
*Aircraft System Identification: Theory and Practice*, 2nd ed., 2016, example 6.3; and the published
equation-error and output-error results of the second record).
"""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import welch

from airtruth import aircraft
from airtruth.checks.kinematics import check_kinematics
from airtruth.identification import METHODS, identify_batch, quantities
from airtruth.importers import MappingFile, import_log, read_mapping, record_constants
from airtruth.importers.mapping import Channel
from airtruth.importers.sources import open_source
from airtruth.logs.flight_log import batches
from airtruth.tracing import TraceOptions, trace
from airtruth.units import DEG

pytestmark = pytest.mark.slow

MAPPING = Path(__file__).resolve().parents[2] / "data" / "mappings" / "sidpac.toml"
KNOWN, SECOND = "totter_9752ed20_data.mat", "totter_lon_020213f1_018.mat"
NAMES = ("Cmalpha", "Cmq", "Cmde")
EQUATION_ERROR = {"Cmalpha": (-1.476, 0.022), "Cmq": (-36.35, 0.69), "Cmde": (-1.869, 0.020)}


def q_dot_rad_s2(path):
    return open_source(path).arrays["fdata"][:, 42] * DEG


def moment_parameters(log, q_dot):
    """M_alpha, M_q, M_de by least squares on alpha, q, elevator and a constant; and R squared."""
    c = log.channels
    x = np.column_stack([c["alpha_rad"], c["q_rad_s"], c["elevator_rad"], np.ones(len(q_dot))])
    theta = np.linalg.lstsq(x, q_dot, rcond=None)[0]
    left = q_dot - x @ theta
    return theta[:3], 1.0 - (left @ left) / np.sum((q_dot - q_dot.mean()) ** 2)


def with_measured_density() -> MappingFile:
    """The second record holds density: 4 % above that of the standard atmosphere at its altitude."""
    mapping = read_mapping(MAPPING)
    channels = {n: c for n, c in mapping.channels.items() if n != "altitude_m"}
    channels["density_kg_m3"] = Channel(column=29, variable="fdata", unit="slug_ft3")
    return mapping.model_copy(update={"channels": channels})


def test_the_textbooks_three_numbers_to_all_digits(measured):
    path = measured(KNOWN)
    imported = import_log(path, MAPPING)
    assert imported.faults == ()
    theta, r_squared = moment_parameters(imported.log, q_dot_rad_s2(path))
    np.testing.assert_array_equal(np.round(theta, 8), [-5.24456750, -2.59795116, -7.85210162])
    assert round(r_squared, 4) == 0.9975


def test_constants_come_with_the_record(measured):
    log = import_log(measured(SECOND), MAPPING).log
    found = record_constants(log, log.run_ids[0])
    # 338.769 slug, 24273 slug ft2, 422.483473 ft2, 6.496063 ft
    assert found == pytest.approx(
        {"mass_kg": 4943.968, "inertia_yy_kg_m2": 32909.77, "wing_area_m2": 39.25000, "chord_m": 1.980000},
        rel=1e-6,
    )


def test_equation_error_on_the_files_own_q_dot(measured):
    """Within one standard error of what was published: channels, units and constants are right."""
    path = measured(SECOND)
    log = import_log(path, with_measured_density()).log
    k = record_constants(log, log.run_ids[0])
    theta, _ = moment_parameters(log, q_dot_rad_s2(path))
    speed, density = (log.channels[n].mean() for n in ("airspeed_m_s", "density_kg_m3"))
    moment = 0.5 * density * speed**2 * k["wing_area_m2"] * k["chord_m"] / k["inertia_yy_kg_m2"]
    values = theta / moment / np.array([1.0, k["chord_m"] / (2.0 * speed), 1.0])
    for name, value in zip(NAMES, values, strict=True):
        published, std = EQUATION_ERROR[name]
        assert abs(value - published) < std, name


@pytest.mark.parametrize("name", [n for n, m in METHODS.items() if not m.channels])
def test_every_method_against_the_published_equation_error(name, measured):
    """Cmalpha within two published standard errors, Cmq and Cmde within 3.3.

    The published figures use the file's q_dot, which is smoothed (next test): it is 2 to 6 % short between
    2 and 4 Hz, where Cmq and Cmde are decided. Methods here use q itself and come out 2 to 6 % larger.
    """
    log = import_log(measured(SECOND), with_measured_density()).log
    constants = SimpleNamespace(**record_constants(log, log.run_ids[0]))
    estimates = identify_batch(next(batches(log)), constants, name)
    assert estimates.converged.all()
    q = quantities(estimates)
    for parameter, most in zip(NAMES, (2.0, 3.3, 3.0), strict=True):
        value = q.value[0, q.names.index(parameter)]
        published, std = EQUATION_ERROR[parameter]
        print(
            f"{name:16s} {parameter:8s} {value:8.3f}  published {published} +- {std}: {(value - published) / std:+.1f}"
        )
        assert abs(value - published) < most * std, parameter


def test_the_files_q_dot_is_smoothed(measured):
    path = measured(SECOND)
    log = import_log(path, MAPPING).log
    own = np.abs(np.fft.rfft(np.gradient(log.channels["q_rad_s"], 0.02) * np.hanning(len(log.t_s))))
    file = np.abs(np.fft.rfft(q_dot_rad_s2(path) * np.hanning(len(log.t_s))))
    hertz = np.fft.rfftfreq(len(log.t_s), 0.02)

    def ratio(low, high):
        band = (hertz >= low) & (hertz < high)
        return np.sqrt(np.sum(file[band] ** 2) / np.sum(own[band] ** 2))

    assert ratio(0.3, 1.0) == pytest.approx(1.0, abs=0.01)
    assert 0.92 < ratio(2.0, 4.0) < 0.98
    assert ratio(5.0, 8.0) < 0.05


def test_smoothing_q_dot_alone_makes_the_difference(measured):
    """The derivative of q, smoothed as the file's is, gives the file's figures; smoothing the regressors
    too takes the difference away again.
    """
    path = measured(SECOND)
    log = import_log(path, MAPPING).log
    file, own = q_dot_rad_s2(path), np.gradient(log.channels["q_rad_s"], 0.02)
    hertz, of_file = welch(file, 50.0, nperseg=160)
    gain = np.sqrt(of_file / welch(own, 50.0, nperseg=160)[1])
    gain[0] = 1.0

    def smoothed(x):
        line = np.linspace(x[0], x[-1], len(x))
        odd = np.concatenate([-(x - line)[::-1], x - line, -(x - line)[::-1]])
        shaped = np.fft.rfft(odd) * np.interp(np.fft.rfftfreq(len(odd), 0.02), hertz, gain)
        return np.fft.irfft(shaped, len(odd))[len(x) : 2 * len(x)] + line

    both = replace(log, channels={n: smoothed(v) for n, v in log.channels.items()})
    plain, published_way = moment_parameters(log, own)[0], moment_parameters(log, file)[0]
    np.testing.assert_allclose(moment_parameters(log, smoothed(own))[0], published_way, rtol=3e-3)
    np.testing.assert_allclose(moment_parameters(both, file)[0], plain, rtol=5e-3)
    assert abs(plain[1] / published_way[1] - 1.0) > 0.03


def test_lag_and_arm_of_the_second_record_are_one_class(measured):
    """Prototype findings on this campaign: a lag of 22 to 25 ms, or an arm of 1.6 to 1.8 m."""
    result = check_kinematics(import_log(measured(SECOND), MAPPING).log)
    print(*result.sentences)
    assert result.verdict == "one_of"
    names = {c.name for c in result.possible}
    assert "none" not in names
    assert names >= {"vane_lag", "vane_arm"}
    arm, lag = (result.finding(n) for n in ("vane_arm", "vane_lag"))
    assert arm.lower < 1.7 < arm.upper
    assert lag.lower < 0.0235 < lag.upper


@pytest.mark.study
def test_the_second_record_lacks_an_arm_or_a_lag(measured):
    """One record, so that all is provisional; kinematics alone has an arm of 1.7 m."""
    plane = aircraft.load(Path(__file__).resolve().parent / "twin_otter")
    log = import_log(measured(SECOND), with_measured_density()).log
    answer = trace(log, plane, TraceOptions()).to_dict()
    print(
        answer["verdict"],
        [(e["name"], e["indistinguishable_from"], e["parameters"]) for e in answer["effects"]],
    )
    assert answer["verdict"] in ("traced", "one_of")
    assert answer["provisional"]
    known = {"vane_arm", "vane_lag", "accelerometer_arm"}
    found = [e for e in answer["effects"] if {e["name"], *e["indistinguishable_from"]} <= known]
    assert len(found) == 1
    if found[0]["name"] == "vane_arm":
        assert found[0]["parameters"]["x_m"]["value"] == pytest.approx(1.7, abs=0.2)
    before, after = (answer["error"][stage]["fit"]["free_run"] for stage in ("before", "after"))
    print(before, after)
    for channel, share in (("alpha_rad", 0.6), ("q_rad_s", 0.9), ("az_m_s2", 0.6)):
        assert after[channel] < share * before[channel]
