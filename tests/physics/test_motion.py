"""The descriptions of the motions: names, order and uniqueness."""

from __future__ import annotations

import pytest

from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion


def test_longitudinal_names_are_those_of_the_paper() -> None:
    # M. Brunot, table 1: six derivatives, then natural frequency and damping ratio
    assert (
        LONGITUDINAL.parameters
        == ("CLalpha", "CLq", "CLde", "Cmalpha", "Cmq", "Cmde")
        == LONGITUDINAL.parameters
    )
    assert LONGITUDINAL.modal == ("wn_rad_s", "zeta") == LONGITUDINAL.modal


def test_lateral_names_are_those_of_klein_and_morelli() -> None:
    # Aircraft System Identification, 2006, ch. 3: side force, rolling and yawing moment in beta, p, r and two controls
    assert LATERAL.parameters == tuple(
        f"{c}{s}" for c in ("CY", "Cl", "Cn") for s in ("beta", "p", "r", "da", "dr")
    )
    assert LATERAL.units["Clp"] == "-"
    assert LATERAL.units["Cnbeta"] == "1/rad"


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=list(MOTIONS))
def test_description_is_consistent(motion: Motion) -> None:
    names = [c.name for c in motion.coefficients]
    assert len(set(motion.parameters)) == len(motion.parameters) == motion.shape[0] * motion.shape[1]
    for d in motion.derivatives:
        assert motion.parameters[motion.index(d.name)] == d.name
        assert motion.index(d.name) in range(*motion.row(names[d.row]).indices(99))
        assert motion.index(d.name) in range(*motion.column(motion.signals[d.column].name).indices(99))
    late = [output.late for output in motion.outputs]
    assert late == sorted(late)
    assert motion.implicit[0] in names
    assert motion.implicit[1] in {state.name for state in motion.states}
    controls = {control.channel for control in motion.controls}
    states = {state.channel for state in motion.states}
    assert {signal.channel for signal in motion.signals} <= controls | states
