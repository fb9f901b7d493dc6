"""Aircraft of the JSBSim wheel in calm air: each determined lateral derivative against the linearisation."""

import numpy as np
import pytest

from airtruth.physics.motion import LATERAL
from studies import foreign_lateral_calm as study

pytestmark = pytest.mark.slow


def test_determined_derivatives_are_those_of_the_model(tmp_path):
    made = study.compared("c310", tmp_path)
    assert made.determined.sum() >= 11
    assert made.missed.size == 0


def test_a_rolling_moment_by_the_bank_angle_is_the_error_of_the_l410(tmp_path):
    """L410.xml has a function `aero/coefficient/Clroll` of the bank angle, which no lateral derivative describes."""
    made = study.compared("L410", tmp_path)
    off = [LATERAL.index(name) for name in ("Clbeta", "Clp")]
    assert set(made.missed) == set(off)
    assert (np.abs(made.error[study.EXPERIMENTS.index("bank as a signal")][off]) < 0.01).all()
