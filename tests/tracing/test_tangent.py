"""The tangent linear model of the filter: against flights of the filter with small increments."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from added_signals import Added, flown_with
from scipy.signal import lsim, lti

from airtruth.effects.increment import Memory, Shape, increment
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change, SensorTerm
from airtruth.tracing.inference.direction import Direction, extended_by
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.learning.increment_inputs import FlownMotion, sensitivities_to
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.records import FINE
from airtruth.tracing.model.response import filter_inputs, respond_to
from airtruth.tracing.model.tangent import POINTS, flown_of, propagated, tangent_of

LATE = Change(sensors=(SensorTerm("q_rad_s", "lag", 0.03), SensorTerm("az_m_s2", "delay", 0.015)))
"""Sensors with a lag and a delay."""
CASES = {
    "plain": (Change(), 2, 0.0, {}),
    "four cells": (Change(), 4, 0.0, {}),
    "late sensors": (LATE, 2, 0.0, {}),
    "correlated noise": (Change(), 2, 0.4, {}),
    "uncertain surface": (Change(), 2, 0.0, {"corner_rad2": 60}),
}
"""Name -> change, cells to a sample, share of correlated noise, and the sample with an uncertain surface."""


def flown(change, sub, share, uncertain):
    """What the filter is given, its parameters, and its tangent linear model."""
    record = tr.fly(np.random.default_rng(5), samples=120)
    signals = record.signals
    if sub != signals.sub:
        grid = np.arange((120 - 1) * sub + 1) * tr.DT / sub
        names = ("airspeed_m_s", "ground_m_s", "density_kg_m3", "theta_rad")
        times = np.arange((120 - 1) * signals.sub + 1) * tr.DT / signals.sub
        finer = {n: np.interp(grid, times, getattr(signals, n)) for n in names}
        fine = np.linspace(0.0, grid[-1], (120 - 1) * sub * FINE + 1)
        finer["controls_rad"] = np.asarray(tr.doublet(fine))[None]
        signals = replace(signals, sub=sub, **finer)
    if uncertain:
        corner = np.zeros(120)
        corner[uncertain["corner_rad2"]] = (0.3 * np.pi / 180.0) ** 2
        signals = replace(signals, corner_rad2=corner[None])
    record = replace(record, signals=signals)
    given = filter_inputs(record, change)
    point = tr.point([record])
    common = point.common.copy()
    common[SHORT_PERIOD.common.colour_shares] = share
    arguments = given, tr.SETTINGS, common, point.per_record[0]
    return arguments, tangent_of(*arguments)


@pytest.mark.parametrize("name", CASES)
def test_increments_change_the_innovations_as_in_flights(name):
    """Central differences of flights with the gains of the filter held; 1e-4 of the largest change, from the step of 1e-6."""
    arguments, tangent = flown(*CASES[name])
    given = arguments[0]
    base = respond_to(*arguments)
    rng = np.random.default_rng(2)
    points = given.grid.lift.size
    lift, moment = rng.normal(size=(2, points))
    output = rng.normal(size=(len(given.y), 3))
    lift[0] = moment[0] = 0.0  # a late sensor is settled with them
    cells = given.record.signals.sub
    first = np.arange((points - 1) // 2) * 2
    at = first[:, None] + np.arange(POINTS)
    force = np.stack([lift[at], moment[at]], axis=2)
    cases = {
        "lift": (force * [[[1.0, 0.0]]], 0.0 * output),
        "moment": (force * [[[0.0, 1.0]]], 0.0 * output),
        "output": (0.0 * force, output),
    }
    assert tangent.steps == cells // 2
    for kind, (own, reading) in cases.items():
        found = propagated(tangent, own[..., None], reading[..., None])[0]
        h = 1e-6
        ends = [
            flown_with(
                Added(
                    sign * h * np.array([lift * (kind == "lift"), moment * (kind == "moment")]),
                    sign * h * output * tangent.sensors.scale * (kind == "output"),
                ),
                *arguments,
                steady=base.steady,
            )
            for sign in (1.0, -1.0)
        ]
        expected = (ends[0] - ends[1]) / (2.0 * h)
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max(), err_msg=kind)


@pytest.fixture(scope="module")
def null():
    """A problem of three records and its null."""
    records = [tr.fly(np.random.default_rng(k), samples=250, name=f"r{k}") for k in range(3)]
    problem = tr.problem(records)
    hypothesis = Hypothesis(Change())
    return problem, fit(problem, hypothesis, initial_parameters(problem, hypothesis))


SHAPES = {
    "function of alpha": (Shape("Cm", "alpha", -0.02, 0.02, 4, 0.0), 0.01),
    "function of the elevator": (Shape("CL", "elevator", -0.03, 0.03, 4, 0.0), 0.01),
    "elevator over alpha": (Shape("Cm", "alpha", -0.02, 0.02, 4, 0.0, None, "elevator", 0.0), 0.01),
    "lag of the elevator": (Shape("Cm", "elevator", -0.03, 0.03, 0, 0.0, Memory("lag", 0.2)), 0.01),
    "lag of alpha": (Shape("Cm", "alpha", -0.02, 0.02, 0, 0.0, Memory("lag", 0.2)), 0.03),
    "mode of the elevator": (Shape("CL", "elevator", -0.03, 0.03, 0, 0.0, Memory("mode", 0.1, 0.2)), 0.01),
    "reading of the vane": (Shape("alpha_rad", "alpha", -0.02, 0.02, 4, 0.0), 0.06),
    "mode at az": (Shape("az_m_s2", "elevator", -0.03, 0.03, 0, 0.0, Memory("mode", 0.03, 0.1)), 0.02),
}
"""Shapes, and how far from differences of whole filters their sensitivities may be, over their norm. The tangent neglects how
memories and readings change the gain, and what the updates of the filter do to a memory that follows the gusts."""


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_change_the_innovations_as_refitted_filters_do(null, name):
    """Against differences of whole filters, gains included."""
    problem, fitted = null
    shape, limit = SHAPES[name]
    effect = increment(shape)
    made = sensitivities_to(fitted, problem, [shape])
    assert made is not None
    own = slice(SHORT_PERIOD.common.size, SHORT_PERIOD.common.size + effect.bends)
    neutral = {p.name: shape.estimated_memory.get(p.name, 0.0) for p in effect.parameters}
    tried = []
    for p in effect.parameters[: effect.bends]:
        single = replace(
            effect,
            parameters=(p,),
            describe=lambda values: effect.describe(neutral | dict(values)),
        )
        tried.append(Direction(single, (), 0.01 * p.step))
    for found, expected in zip(made, extended_by(fitted, problem, tried), strict=True):
        scale = np.linalg.norm(expected.t[own])
        assert np.linalg.norm(found.t[own] - expected.t[own]) < limit * scale


def test_many_shapes_pass_in_blocks(null, monkeypatch):
    """With blocks of one shape, to rounding."""
    problem, fitted = null
    every = [shape for shape, _ in SHAPES.values()]
    whole = sensitivities_to(fitted, problem, every)
    monkeypatch.setattr("airtruth.tracing.learning.increment_inputs._BLOCK", 1)
    assert len(whole)
    for one, own in zip(whole, sensitivities_to(fitted, problem, every), strict=True):
        np.testing.assert_allclose(own.t, one.t, rtol=1e-9, atol=1e-9 * np.abs(one.t).max())


def test_memories_follow_the_motion():
    """A lag, a mode and a play of the elevator against `scipy.signal.lsim` and a loop, on the filter's own grid."""
    _, tangent = flown(*CASES["plain"])
    motion = FlownMotion(tangent, LONGITUDINAL)
    surface = tangent.matrices.flown[:, :, flown_of(LONGITUDINAL).index("elevator")]
    series = np.append(surface[:, 0], surface[-1, -1])
    t = np.arange(series.size) * tangent.h_s
    lag = motion.state(Memory("lag", 0.15), "elevator")
    _, expected, _ = lsim(lti([1.0], [0.15, 1.0]), series - series[0], t)
    np.testing.assert_allclose(np.append(lag[:, 0], lag[-1, -1]) - series[0], expected, atol=1e-12)
    wn, damping = 1.0 / 0.08, 0.1
    mode = motion.state(Memory("mode", 0.08, damping), "elevator")
    _, expected, _ = lsim(lti([wn**2], [1.0, 2.0 * damping * wn, wn**2]), series - series[0], t)
    np.testing.assert_allclose(np.append(mode[:, 0], mode[-1, -1]) - series[0], expected, atol=1e-12)
    half = 0.3 * np.abs(series).max()
    play, held = motion.state(Memory("play", half_width=half), "elevator"), series[0]
    for k, s in enumerate(series[1:]):
        assert play[k, 0] == held
        held = min(max(held, s - half), s + half)
    assert play[-1, -1] == held
    assert np.ptp(play) > 0.0
