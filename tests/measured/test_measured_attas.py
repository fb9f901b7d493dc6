"""ATTAS: the angle of attack is declared at the CG and was measured 13.08 m ahead of it (R. V. Jategaonkar,
*Flight Vehicle System Identification*, 2006, companion code), which kinematics alone must show.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth.checks.gate import inspect
from airtruth.checks.kinematics import check_kinematics
from airtruth.importers import import_log, read_mapping

pytestmark = pytest.mark.slow

HERE = Path(__file__).resolve().parent
RECORDS = ("fAttasElv1", "fAttasElv2")
ARM_M = 13.08


@pytest.fixture
def logs(measured):
    mapping = read_mapping(HERE / "attas.toml")
    result = []
    for name in RECORDS:
        source = mapping.source.model_copy(update={"variable": name})
        imported = import_log(measured(f"{name}.mat"), mapping.model_copy(update={"source": source}))
        assert imported.faults == ()
        result.append(imported.log)
    return result


CHORD_M = 3.159


def test_each_record_shows_the_arm_in_one_class(logs):
    for log in logs:
        result = check_kinematics(log, None, CHORD_M)
        print(log.run_ids, *result.sentences)
        arm = result.finding("vane_arm")
        assert arm.state == "one of"
        assert arm.lower < ARM_M < arm.upper
        assert arm.upper - arm.lower < 6.0
        assert {c.name for c in result.possible} >= {"vane_arm", "accelerometer_arm"}


def test_both_records_show_it_and_exclude_delay_and_lag(logs):
    result = check_kinematics(logs, None, CHORD_M)
    print(*result.sentences)
    arm = result.finding("vane_arm")
    assert arm.value == pytest.approx(ARM_M, abs=0.5)
    assert arm.lower < ARM_M < arm.upper
    # kinematics gives both the same motion
    assert {c.name for c in result.possible} == {"vane_arm", "accelerometer_arm"}
    assert result.verdict == "one_of"
    # the book's output error has 3.34e-3 rad/s
    assert result.finding("gyro_bias").value == pytest.approx(3.34e-3, abs=3e-4)


def test_once_declared_it_is_not_found_again(logs):
    result = check_kinematics(logs, {"vane_arm": ARM_M}, CHORD_M)
    assert {c.name for c in result.possible} == {"none"}
    # no kinematic model of few terms explains a real record exactly
    assert result.verdict in ("cannot_tell", "errors")
    assert result.enlargement > 1.0


@pytest.mark.long
def test_wrong_signs_and_units_of_real_records_are_refused(logs):
    for log in logs:
        for name, factor in (
            ("elevator_rad", -1.0), ("q_rad_s", -1.0), ("alpha_rad", -1.0), ("theta_rad", -1.0), ("az_m_s2", -1.0),
            ("q_rad_s", np.pi / 180.0), ("airspeed_m_s", 1.0 / 0.3048),
        ):  # fmt: skip
            wrong = replace(
                log, channels={n: v * factor if n == name else v for n, v in log.channels.items()}
            )
            certain = [fault.channel for fault in inspect(wrong) if fault.certain]
            assert certain == [name], (name, factor)
