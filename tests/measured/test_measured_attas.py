"""ATTAS: the angle of attack is declared at the CG and was measured 13.08 m ahead of it (R. V. Jategaonkar,
*Flight Vehicle System Identification*, 2006, companion code), which kinematics alone must show.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth.identify.kinematics import check_kinematics
from airtruth.identify.kinematics_report import shown
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.importers import import_log, read_mapping

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
        assert imported.problems == ()
        result.append(imported.log)
    return result


def together(logs):
    lengths = [len(log.t_s) for log in logs]
    return FlightLog(
        metadata={},
        run_ids=tuple(log.run_ids[0] for log in logs),
        offsets=np.cumsum([0, *lengths]).astype(np.int64),
        t_s=np.concatenate([log.t_s for log in logs]),
        channels={n: np.concatenate([log.channels[n] for log in logs]) for n in logs[0].channels},
    )


def arm_of(log):
    result = check_kinematics(log)
    causes = {c.name: c for c in result.causes}
    print(log.run_ids, *(f"{c.name} {shown(c.cause)}" for c in result.causes if c.cause))
    return result, causes


def test_each_record_shows_the_arm(logs):
    for log in logs:
        _, causes = arm_of(log)
        arm = causes["vane_arm"].cause
        assert arm.lower < ARM_M < arm.upper
        assert arm.std < 1.0
        assert causes["vane_arm"].possible


def test_both_records_show_it_closer_and_exclude_delay_and_lag(logs):
    result, causes = arm_of(together(logs))
    arm = causes["vane_arm"]
    assert arm.cause.value == pytest.approx(ARM_M, abs=0.5)
    assert arm.alpha_scale.lower < 1.0 < arm.alpha_scale.upper
    possible = {name for name, cause in causes.items() if cause.possible}
    assert possible == {"vane_arm", "accelerometer_arm"}  # kinematics gives both the same motion
    # the book's output error has 3.34e-3 rad/s
    bias = next(f for f in result.findings if f.name == "gyro_bias")
    assert bias.value == pytest.approx(3.34e-3, abs=3e-4)


def test_once_declared_it_is_not_found_again(logs):
    result = check_kinematics(together(logs), {"vane_arm": ARM_M})
    none = next(c for c in result.causes if c.name == "none")
    assert none.possible


def test_wrong_signs_and_units_of_real_records_are_refused(logs):
    from airtruth.logs.importers import problems

    for log in logs:
        for name, factor in (
            ("elevator_rad", -1.0), ("q_rad_s", -1.0), ("alpha_rad", -1.0), ("theta_rad", -1.0), ("az_m_s2", -1.0),
            ("q_rad_s", np.pi / 180.0), ("airspeed_m_s", 1.0 / 0.3048),
        ):  # fmt: skip
            wrong = replace(
                log, channels={n: v * factor if n == name else v for n, v in log.channels.items()}
            )
            certain = [p.channel for p in problems(wrong) if p.certain]
            assert certain == [name], (name, factor)
