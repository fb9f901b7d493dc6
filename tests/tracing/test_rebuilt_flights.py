"""Flights that earlier tracers answered wrongly: damage that moves every derivative, a slow vane with a late surface."""

import pytest
import rebuilt_flights as rebuilt

from airtruth import aircraft as planes
from airtruth.tracing import TraceOptions, trace

pytestmark = pytest.mark.long

TAIL = pytest.mark.xdist_group("lost tail")
"""Tests of one answer, which one process traces."""
BENT = {"cm_alpha_nonlinear", "cl_alpha_nonlinear"}
CHANNELS = ("alpha_rad", "q_rad_s", "az_m_s2")
SLOPES = {
    "tail_effectiveness",
    "wing_effectiveness",
    "aerodynamic_center",
    "dynamic_pressure",
    "icing",
    "derivatives",
}
"""Causes that change derivatives and nothing else."""


@pytest.fixture(scope="session")
def damaged(tmp_path_factory):
    return rebuilt.fly_damaged(tmp_path_factory.mktemp("damaged"))


@pytest.fixture(scope="session")
def transport(tmp_path_factory):
    return rebuilt.fly_transport(tmp_path_factory.mktemp("transport"))


@pytest.fixture(scope="module")
def answered(damaged, tmp_path_factory):
    """Answer to a row, traced when it is first asked for."""
    known = {}

    def answer(row, declared="gtm"):
        key = (row, str(declared))
        if key not in known:
            out = tmp_path_factory.mktemp(row)
            known[key] = trace(damaged[row], declared, TraceOptions(), out).to_dict()
        return known[key]

    return answer


def names(effect):
    return {effect["name"], *(key.split(":")[0] for key in effect["indistinguishable_from"])}


def named(answer):
    return [names(effect) for effect in answer["effects"]]


def sets(answer):
    """The sets of names that an answer reports as alternatives."""
    return [{key.split(":")[0] for key in a["effects"]} for a in answer["alternatives"]]


def holds(answer, name, parameter, value):
    """Whether the interval of an effect that is named itself holds a value; true of one named as a look-alike."""
    for effect in answer["effects"]:
        if effect["name"] == name:
            low, high = effect["parameters"][parameter]["ci95"]
            return (low is None or low <= value) and (high is None or value <= high)
    return any(name in found for found in named(answer))


def no_worse_unstated(answer):
    """Held-out errors after are those before or less, or the answer says that it is not confirmed."""
    before, after = (answer["error"][stage]["held_out"] for stage in ("before", "after"))
    worse = any(
        after[kind][channel] > 1.1 * before[kind][channel]
        for kind in ("free_run", "innovation")
        for channel in CHANNELS
    )
    return not worse or (answer["confirmed"] is False and answer["provisional"])


# -- damage; derivatives are declared to 5 % (Cmq 15 %, CLde 10 %, CLq 30 %)


@TAIL
def test_a_lost_tail_is_named_and_not_a_curvature(answered):
    """Cmalpha, Cmq, CLde and Cmde are halved: noncentrality 242 against anything that the declaration allows."""
    a = answered("tail")
    assert not a["declared_model"]["consistent"]
    assert a["declared_model"]["p_value"] < 1e-6
    assert any(found & {"tail_effectiveness", "derivatives"} for found in named(a))
    assert not {e["name"] for e in a["effects"]} <= BENT
    assert a["verdict"] in ("traced", "one_of")
    assert no_worse_unstated(a)


@TAIL
def test_the_corrected_aircraft_without_half_of_its_tail_has_its_derivatives(answered):
    """Apparent derivatives of the truth, by hand: CL over mass, Cm with the transfer over inertia."""
    a = answered("tail")
    declared, after = a["derivatives"]["declared"], a["derivatives"]["after"]
    shift = dict(rebuilt.DAMAGED["tail"][0].values)
    cl = {n: declared[n] + shift[f"d{n}"] for n in ("CLalpha", "CLq", "CLde")}
    cm = {n: declared[n] + shift[f"d{n}"] - 0.04 * cl["CL" + n[2:]] for n in ("Cmalpha", "Cmq", "Cmde")}
    for name in ("Cmalpha", "Cmde"):
        assert after[name] == pytest.approx(cm[name] / 0.94, rel=0.1)
    assert after["Cmq"] == pytest.approx(cm["Cmq"] / 0.94, rel=0.15)
    assert planes.load(a["updated_aircraft"]).name == "gtm"
    assert a["declared_model"]["shifts"]["Cmalpha"]["sigma"] > 4.0


@TAIL
def test_the_headline_error_is_that_of_the_declared_aircraft(answered):
    errors = answered("tail")["error"]
    for channel in CHANNELS:
        assert (
            errors["after"]["held_out"]["free_run"][channel]
            < 0.2 * errors["declared"]["held_out"]["free_run"][channel]
        )
        floor = errors["floor"]["held_out"]["free_run"][channel]
        assert floor < 1.5 * errors["before"]["held_out"]["free_run"][channel]


@pytest.mark.study
def test_a_lost_wing_tip_is_never_a_curvature_alone(answered):
    """Its noncentrality is 5: the declared uncertainty nearly allows it."""
    a = answered("wing")
    assert not a["effects"] or not {e["name"] for e in a["effects"]} <= BENT
    assert (a["verdict"] == "none") <= a["declared_model"]["consistent"]
    if not a["declared_model"]["consistent"]:
        assert a["updated_aircraft"]
        assert any(found & (SLOPES | {"cg_shift", "mass_error"}) for found in named(a))


def test_a_forward_cg_and_the_inertia_are_both_named(answered):
    """CG 10.6 % forward, inertia 0.876, mass 0.977: together a noncentrality of 54."""
    a = answered("forward")
    assert not a["declared_model"]["consistent"]
    assert any("cg_shift" in found for found in named(a))
    assert any("inertia_error" in found for found in named(a))
    assert holds(a, "cg_shift", "dx_mac", -0.106)
    assert holds(a, "inertia_error", "factor", 0.876)
    assert a["updated_aircraft"]


@pytest.mark.study
def test_half_an_elevator_is_named_without_curvatures(answered):
    a = answered("elevator")
    assert not a["declared_model"]["consistent"]
    assert any("elevator_effectiveness" in found for found in named(a))
    assert holds(a, "elevator_effectiveness", "factor", 0.5)
    assert not {e["name"] for e in a["effects"]} & BENT


def test_an_aft_cg_contradicts_derivatives_that_are_declared_to_half_a_percent(answered, tmp_path):
    """Cmalpha is 10 % off: 20 declared standard deviations here, forty of those that the records leave."""
    a = answered("aft", rebuilt.well_declared(tmp_path / "gtm"))
    assert not a["declared_model"]["consistent"]
    assert a["verdict"] in ("traced", "one_of")
    reported = [*named(a), *sets(a)]
    assert any("cg_shift" in found for found in reported)
    assert any("derivatives" in found for found in reported)
    assert a["updated_aircraft"]
    low, high = a["declared_model"]["shifts"]["Cmalpha"]["ci95"]
    assert low < -1.785 + 0.04 * 4.787 < high


@pytest.mark.study
def test_an_aft_cg_is_measured_where_the_declaration_allows_it(answered):
    """Derivatives declared to 5 %: two standard deviations, noncentrality 4. Whatever the verdict, the slope is right."""
    a = answered("aft")
    assert not {e["name"] for e in a["effects"]} & BENT
    assert abs(a["derivatives"]["after"]["Cmalpha"] + 1.785 - 0.04 * 4.787) < 0.06
    if not a["declared_model"]["consistent"]:
        assert a["updated_aircraft"]


# -- a large transport: its vane lags by 0.45 s, its surface acts 90 ms late; two fitted records, one held out


def test_a_slow_vane_and_a_late_surface_are_both_named(transport, tmp_path):
    a = trace(transport, rebuilt.transport(tmp_path / "transport", 0.0), TraceOptions()).to_dict()
    assert any("vane_lag" in found for found in named(a))
    assert any("elevator_delay" in found for found in named(a))
    assert not {"lift_lag", "downwash_lag", "lift_alpha_dot"} & {e["name"] for e in a["effects"]}
    assert holds(a, "vane_lag", "tau_s", rebuilt.VANE_LAG_S)
    assert holds(a, "elevator_delay", "delay_s", rebuilt.SURFACE_DELAY_S)
    assert no_worse_unstated(a)


def test_a_late_surface_behind_a_declared_lag_is_named(transport, tmp_path):
    a = trace(
        transport, rebuilt.transport(tmp_path / "transport", rebuilt.VANE_LAG_S), TraceOptions()
    ).to_dict()
    assert any("elevator_delay" in found for found in named(a))
    assert holds(a, "elevator_delay", "delay_s", rebuilt.SURFACE_DELAY_S)
    before, after = (a["error"][stage]["held_out"]["free_run"] for stage in ("before", "after"))
    assert all(after[channel] <= 1.02 * before[channel] for channel in CHANNELS)
