"""The error of the derivatives by a late elevator, against a closed form and an independent regression."""

import numpy as np
import pytest

from airtruth.errors import ConfigurationError
from airtruth.physics.late_surface import shift_of_a_delay
from airtruth.physics.short_period import scale

THETA = np.array([5.2, 7.5, 0.36, -0.9, -14.0, -1.1])
AT = scale(0.96, 0.30, 12.0, 1.10, 22.0, 1.2075)


def test_an_elevator_in_time_leaves_the_derivatives():
    np.testing.assert_allclose(shift_of_a_delay(THETA, AT, 0.0), 0.0, atol=1e-9)


def test_a_late_elevator_takes_damping_and_effectiveness_away():
    """Signs as in a real case: Cmq of -12 was estimated as +1.7 and Cmde of -1.0 as -0.48 for an undeclared servo delay."""
    small, large = (shift_of_a_delay(THETA, AT, delay) for delay in (0.02, 0.06))
    for shift in (small, large):
        assert shift[4] > 0.0
        assert shift[5] > 0.0
    assert large[4] > small[4]
    assert large[5] > small[5]


def test_it_is_the_regression_of_a_simulated_record():
    """Euler steps of 0.1 ms and normal equations of their own."""
    delay, dt = 0.05, 1e-4
    h, (lift, moment) = float(AT.half_chord_time), (float(AT.lift), float(AT.moment))
    wn = np.sqrt(-moment * (THETA[3] * (1.0 - lift * h * THETA[1]) + lift * h * THETA[0] * THETA[4]))
    step = 0.5 * np.pi / wn
    t = np.arange(0.0, 16.0 * step, dt)

    def surface(t):
        edges = np.array([1.0, 4.0, 6.0, 7.0, 8.0]) * step
        return np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[np.searchsorted(edges, t, side="right")]

    late, rows, x = surface(t - delay), [], np.zeros(2)
    for de in late:
        cl = THETA[:3] @ [x[0], h * x[1], de]
        cm = THETA[3:] @ [x[0], h * x[1], de]
        rows.append((*x, cl, cm))
        x = x + dt * np.array([x[1] - lift * cl, moment * cm])
    alpha, q, cl, cm = np.array(rows).T
    given = np.column_stack([alpha, h * q, surface(t)])
    for coefficient, part in ((cl, slice(0, 3)), (cm, slice(3, 6))):
        found = np.linalg.solve(given.T @ given, given.T @ coefficient) - THETA[part]
        np.testing.assert_allclose(shift_of_a_delay(THETA, AT, delay)[part], found, rtol=0.02, atol=2e-3)


def test_an_unstable_short_period_is_refused():
    with pytest.raises(ConfigurationError, match="no stable short period"):
        shift_of_a_delay(THETA * [1, 1, 1, -5, 1, 1], AT, 0.05)
