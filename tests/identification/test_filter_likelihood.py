"""The compiled likelihood and its derivatives against dense Gaussian algebra on the whole record."""

import numpy as np
import pytest
from scipy.linalg import block_diag, expm, solve_discrete_are

from airtruth.errors import ConfigurationError
from airtruth.identification.likelihood.cramer_rao import bound
from airtruth.identification.likelihood.kalman import score
from airtruth.identification.likelihood.kalman_kernel import KalmanSignals
from airtruth.identification.likelihood.predictor import Term, extended, layout, short_period
from validation.linear_flight import LIGHT, NOISE, THETA, fly, gtm_scale

DT, SAMPLES = 0.02, 60
LEVELS = np.array([2.0 * LIGHT[0], 2.0 * LIGHT[1], *NOISE[:3], 0.0309])
STATIONARY = block_diag(np.zeros((2, 2)), np.eye(1), [[1.0, 0.5], [0.5, 0.5]])


def predictor(outputs=("alpha", "q", "az", "airspeed")):
    return short_period(gtm_scale((1,)), LIGHT[2], LIGHT[3], outputs)


def with_more():
    """A vane arm, a lagged surface as a sixth state, and a second input."""
    x = -0.02
    terms = [
        Term("C", "alpha", "q", x, ("arm",)),
        Term("A", "lagged", "lagged", -20.0),
        Term("B", "lagged", "elevator", 20.0),
        Term("A", "q", "lagged", -2.0, ("arm", "other")),
        Term("B", "q", "kink", -1.0, ("other",)),
        Term("D", "az", "kink", 0.3),
    ]
    return extended(predictor(), terms, states=["lagged"], inputs=["kink"], parameters=["arm", "other"])


def data(inputs=1, outputs=4):
    part = fly(runs=1, gust=2.0, noise=1.0, seed=3)
    keep = slice(40, 40 + SAMPLES)
    names = ("alpha_rad", "q_rad_s", "az_m_s2", "airspeed_m_s")[:outputs]
    y = np.stack([part.channels[n][0, keep] for n in names], axis=1)
    y[:, 3:] += 0.1 * np.random.default_rng(1).normal(size=y[:, 3:].shape).cumsum(axis=0)
    u = part.channels["elevator_rad"][0, keep, None]
    u = np.hstack([u, np.abs(u)])[:, :inputs]
    bend = 1e-3 * np.random.default_rng(2).normal(size=u.shape)
    return y - y[0], np.ascontiguousarray(u), bend


def start_z(p, theta=THETA * 1.1):
    extra = len(p.parameters) - 6 - len(p.outputs) - 2
    return np.concatenate([theta, np.log(LEVELS[: 2 + len(p.outputs)]), 0.3 * np.ones(extra)])


def evaluate(p, z, free, y, u, bend):
    made = score(layout(p, 1), np.array([0]), z[None], free, KalmanSignals(y[None], u[None], bend[None]), DT)
    return tuple(part[0] for part in made)


def continuous(p, z):
    """Matrices of the terms, by name rather than by index."""
    value = {n: np.exp(x) if n in p.logarithmic else x for n, x in zip(p.parameters, z, strict=True)}
    shape = {"A": (p.states, p.states), "B": (p.states, p.inputs), "C": (p.outputs, p.states)}
    shape |= {"D": (p.outputs, p.inputs), "Q": (p.states, p.states), "R": (p.outputs, p.outputs)}
    made = {name: np.zeros((len(r), len(c))) for name, (r, c) in shape.items()}
    for t in p.terms:
        rows, columns = shape[t.matrix]
        entry = np.ravel(t.coefficient)[0] * np.prod([value[n] for n in t.parameters])
        made[t.matrix][rows.index(t.row), columns.index(t.column or t.row)] += entry
    return made


def stepped(made):
    """Van Loan's exponentials: transition, noise of a step, and both ends of a linear input."""
    a, b, q = made["A"], made["B"], made["Q"]
    n, inputs = b.shape
    big = expm(np.block([[-a, q], [np.zeros((n, n)), a.T]]) * DT)
    phi = big[n:, n:].T
    hold = np.zeros((n + 2 * inputs, n + 2 * inputs))
    hold[:n, :n], hold[:n, n : n + inputs] = a * DT, b * DT
    hold[n : n + inputs, n + inputs :] = np.eye(inputs)
    hold = expm(hold)
    late = hold[:n, n + inputs :]
    return phi, phi @ big[:n, n:], hold[:n, n : n + inputs] - late, late


def dense(p, z, u, bend, start):
    """Mean, covariance and columns (initial state, biases) of the whole record."""
    made = continuous(p, z)
    phi, noise, early, late = stepped(made)
    n, m, samples = len(p.states), len(p.outputs), len(u)
    if start is None:
        start = solve_discrete_are(phi.T, made["C"].T, noise, made["R"])
    mean, x, transition, covariance = [], np.zeros(n), [np.eye(n)], [start]
    for k in range(samples):
        mean.append(made["C"] @ x + made["D"] @ u[k])
        if k + 1 < samples:
            x = phi @ x + early @ (u[k] + bend[k + 1]) + late @ (u[k + 1] + bend[k + 1])
            transition.append(phi @ transition[-1])
            covariance.append(phi @ covariance[-1] @ phi.T + noise)
    sigma = np.zeros((samples * m, samples * m))
    for i in range(samples):
        for j in range(i + 1):
            block = made["C"] @ transition[i - j] @ covariance[j] @ made["C"].T + (i == j) * made["R"]
            sigma[i * m : (i + 1) * m, j * m : (j + 1) * m] = block
            sigma[j * m : (j + 1) * m, i * m : (i + 1) * m] = block.T
    columns = np.vstack([np.hstack([made["C"] @ t, np.eye(m)]) for t in transition])
    return np.concatenate(mean), sigma, columns


@pytest.mark.parametrize("make", [predictor, lambda: predictor(("alpha", "q", "az")), with_more])
def test_likelihood_is_that_of_the_dense_gaussian(make):
    """Least over initial state and biases of the density of all samples at once."""
    p = make()
    y, u, bend = data(len(p.inputs), len(p.outputs))
    z = start_z(p)
    mean, sigma, columns = dense(p, z, u, bend, None)
    precision = np.zeros((columns.shape[1],) * 2)
    precision[2:5, 2:5] = np.linalg.inv(STATIONARY[2:, 2:])
    misfit = y.ravel() - mean
    weighted = np.linalg.solve(sigma, np.column_stack([misfit, columns]))
    right, normal = columns.T @ weighted[:, 0], columns.T @ weighted[:, 1:] + precision
    expected = 0.5 * (np.linalg.slogdet(sigma)[1] + misfit @ weighted[:, 0])
    expected -= 0.5 * right @ np.linalg.solve(normal, right)
    cost, _, _, innovations = evaluate(p, z, np.arange(0), y, u, bend)
    assert cost == pytest.approx(expected, rel=1e-8)
    assert innovations.shape == y.shape


@pytest.mark.parametrize("make", [predictor, with_more])
def test_gradient_is_that_of_the_cost(make):
    """Against central differences, per standard error of each parameter."""
    p = make()
    y, u, bend = data(len(p.inputs))
    z = start_z(p)
    free = np.arange(z.size)
    assert z.size >= 6
    gradient, information = evaluate(p, z, free, y, u, bend)[1:3]
    scale = 1.0 / np.sqrt(np.diag(information))
    for i in free:
        ends = [evaluate(p, z + s * 1e-3 * scale * (free == i), free, y, u, bend)[0] for s in (-1.0, 1.0)]
        difference = (ends[1] - ends[0]) / 2e-3
        assert gradient[i] * scale[i] == pytest.approx(difference, rel=1e-5, abs=1e-5), p.parameters[i]


@pytest.mark.parametrize("start", [np.zeros((5, 5)), STATIONARY])
def test_bound_is_that_of_the_dense_gaussian(start):
    """mu_i' S^-1 mu_j + tr(S^-1 S_i S^-1 S_j)/2, its derivatives by central differences."""
    p = predictor(("alpha", "q", "az"))
    _, u, bend = data(outputs=3)
    z = start_z(p, THETA)
    free = np.arange(z.size)
    _, sigma, columns = dense(p, z, u, bend, start)
    columns = columns[:, [0, 1, 5, 6, 7]]
    slopes, blocks = [], []
    for i in free:
        h = 1e-5 * max(abs(z[i]), 1.0) * (free == i)
        high, low = dense(p, z + h, u, bend, start), dense(p, z - h, u, bend, start)
        slopes.append((high[0] - low[0]) / (2.0 * h[i]))
        blocks.append(np.linalg.solve(sigma, (high[1] - low[1]) / (2.0 * h[i])))
    rows = np.array(slopes).T
    weighted = np.linalg.solve(sigma, np.hstack([rows, columns]))
    information = rows.T @ weighted[:, : free.size]
    information += 0.5 * np.array([[np.sum(a * b.T) for b in blocks] for a in blocks])
    across = rows.T @ weighted[:, free.size :]
    normal = columns.T @ weighted[:, free.size :]
    expected = np.linalg.inv(information - across @ np.linalg.solve(normal, across.T))
    signals = KalmanSignals(np.empty((1, len(u), 3)), u[None], bend[None])
    got = bound(layout(p, 1), 0, z, free, signals, DT, start, np.arange(2))
    np.testing.assert_allclose(np.sqrt(np.diag(got)), np.sqrt(np.diag(expected)), rtol=1e-5)


def test_names_that_do_not_exist_are_refused():
    with pytest.raises(ConfigurationError, match="did you mean 'airspeed'"):
        predictor(("alpha", "airsped"))
    wrong = extended(predictor(), [Term("A", "alpha", "beta", 1.0)])
    with pytest.raises(ConfigurationError, match="'beta' is not known"):
        layout(wrong, 1)
