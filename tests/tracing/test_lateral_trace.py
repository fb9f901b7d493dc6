"""The whole trace on records of the lateral-directional motion, flown by an independent integration in six axes."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.physics.motion import MOTIONS
from airtruth.simulation.linearise import linearise, truth_of
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.tracing import TraceOptions
from airtruth.tracing.run import trace
from validation import damage as damaged
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import GTM, log_of, record_pair, with_effect

LATERAL = TraceOptions(motion="lateral")


def flights(name="", size=0.0, seed=1, gust=0.5):
    """Four records, aileron 1-2-1 and rudder 3-2-1-1 in both signs, in half of the light gusts."""
    every = [replace(f, gust=gust, seed=100 * seed + i) for i, f in enumerate(record_pair() * 2)]
    return [with_effect(f, name, size) for f in every] if name else every


def without_part_of_the_fin(flight, factor):
    """A flight whose fin, rudder included, has a factor of its lift: strip theory (Etkin and Reid, ch. 2 and 5).

    Arms from the rudder's moments over its force; lift slope from nine tenths of Cnr.
    """
    lateral = flight.plane.lateral.copy()
    behind, above = -lateral[2, 4] / lateral[0, 4], lateral[1, 4] / lateral[0, 4]
    slope = -0.9 * lateral[2, 2] / (2.0 * behind**2)
    felt = np.array([-1.0, -2.0 * above, 2.0 * behind])  # of beta, p b/2V and r b/2V
    lost = slope * np.outer([1.0, above, -behind], felt)
    lateral[:, :3] -= (1.0 - factor) * lost
    lateral[:, 4] *= factor
    return replace(flight, plane=replace(flight.plane, lateral=lateral))


@pytest.mark.slow
def test_records_of_the_declared_aircraft_show_nothing(tmp_path):
    answer = trace([log_of(*flights())], lateral_aircraft(tmp_path / "gtm"), LATERAL).answer
    assert answer.verdict == "none"
    assert set(answer.derivatives.declared) == set(answer.declared_model.shifts)
    assert set(answer.error.channels) == {"beta_rad", "p_rad_s", "r_rad_s", "phi_rad", "ay_m_s2"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size", "parameter"),
    [
        ("rudder_delay", 0.08, "delay_s"),
        ("vane_arm:beta_rad", 0.6, "x_m"),
        ("vane_lag:beta_rad", 0.12, "tau_s"),
    ],
)
def test_an_effect_is_named_with_its_size(tmp_path, name, size, parameter):
    answer = trace([log_of(*flights(name, size))], lateral_aircraft(tmp_path / "gtm"), LATERAL).answer
    (effect,) = answer.effects
    assert effect.key == name
    estimate = effect.parameters[parameter]
    assert estimate.value == pytest.approx(size, abs=max(4.0 * estimate.std, 0.1 * size))


@pytest.mark.slow
def test_a_wrong_damping_in_roll_is_a_wrong_declaration(tmp_path):
    declared = lateral_aircraft(tmp_path / "gtm", wrong={"Clp": 0.7})
    answer = trace([log_of(*flights())], declared, LATERAL).answer
    assert not answer.declared_model.consistent
    shift = answer.declared_model.shifts["Clp"]
    assert shift.estimate == pytest.approx(GTM.lateral[1, 1], abs=4.0 * shift.std)
    assert any("derivatives" in s.effects for s in answer.alternatives)


@pytest.mark.slow
def test_a_weak_fin_is_named(tmp_path):
    weak = [without_part_of_the_fin(f, 0.6) for f in flights()]
    answer = trace([log_of(*weak)], lateral_aircraft(tmp_path / "gtm"), LATERAL).answer
    assert not answer.declared_model.consistent
    assert any("fin_effectiveness" in s.effects for s in answer.alternatives)


@pytest.mark.slow
@pytest.mark.parametrize("left", [0.0, 0.2])
def test_a_lost_rudder_is_named_although_the_derivatives_can_absorb_it(tmp_path, left):
    lateral = GTM.lateral.copy()
    lateral[:, 4] *= left
    case = damaged.Damage(replace(GTM, lateral=lateral), ("rudder_effectiveness",))
    log = log_of(*damaged.flights(case, seed=8)[:4])
    answer = trace([log], lateral_aircraft(tmp_path / "gtm"), replace(LATERAL, increments=False)).answer
    (effect,) = answer.effects
    assert effect.key == "rudder_effectiveness"
    assert effect.parameters["factor"].value == pytest.approx(left, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("case", "key"), [("tip-20", "wing_tip_loss"), ("cg-side-3", "cg_shift_y")])
def test_an_asymmetric_aircraft_has_one_cause_that_predicts_other_records(tmp_path, case, key):
    """Both roll the aircraft with its lift, which follows the gusts; the yaw of the CG tells them apart."""
    log = log_of(*damaged.flights(damaged.CASES[case], seed=7)[:4])
    answer = trace([log], lateral_aircraft(tmp_path / "gtm"), LATERAL, out=tmp_path / "traced").answer
    assert [e.key for e in answer.effects] == [key]
    assert answer.confirmed
    assert answer.updated_aircraft is not None


@pytest.mark.slow
def test_the_update_of_an_aircraft_without_a_jsbsim_model_flies_with_the_effect(tmp_path):
    """The updated aircraft has the late rudder in a JSBSim model of its own, trims in six axes, and is not late when traced."""
    declared = lateral_aircraft(tmp_path / "gtm")
    options = replace(LATERAL, effects=("rudder_delay", "vane_lag:beta_rad"), increments=False)
    answer = trace(
        [log_of(*flights("rudder_delay", 0.08))], declared, options, out=tmp_path / "traced"
    ).answer
    assert [e.key for e in answer.effects] == ["rudder_delay"]
    assert answer.updated_aircraft is not None
    updated = aircraft.load(answer.updated_aircraft)
    found = trim(updated, Condition(38.6, 2134.0, straight="wings-level"))
    true = truth_of(MOTIONS["lateral"], linearise(updated, found, motion=MOTIONS["lateral"]), found)
    after = answer.derivatives.after
    assert {k: true[k] for k in ("Clp", "Cnbeta", "Cndr")} == pytest.approx(
        {k: after[k] for k in ("Clp", "Cnbeta", "Cndr")}, rel=0.01
    )
    text = (updated.folder / f"{updated.folder.name}.xml").read_text(encoding="utf-8")
    assert "rudder_delay" in text
