"""Terms of a changed model: the shape of an aerodynamic increment."""

from __future__ import annotations

from typing import Literal, get_args, get_type_hints

import numpy as np
import pytest

from airtruth.physics.terms import FORMULAS, SHAPES, AeroTerm, shape_of

S = np.array([[-0.2, 0.1], [0.1, 0.4]])
"""Values of a signal; the origin of the terms is 0.1."""


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ("linear", [[-0.3, 0.0], [0.0, 0.3]]),
        ("quadratic", [[0.09, 0.0], [0.0, 0.09]]),
        ("above", [[0.0, 0.0], [0.0, 0.3]]),
        ("below", [[-0.3, 0.0], [0.0, 0.0]]),
    ],
)
def test_shape(shape: Literal["linear", "quadratic", "above", "below"], expected: list[list[float]]) -> None:
    """Expected values by hand from the definitions in `FORMULAS`."""
    term = AeroTerm("Cm", "alpha", shape, amplitude=7.0, at=0.1)
    np.testing.assert_allclose(shape_of(term, S), expected, atol=1e-15)


def test_every_shape_has_a_formula() -> None:
    assert tuple(FORMULAS) == SHAPES == get_args(get_type_hints(AeroTerm)["shape"])
