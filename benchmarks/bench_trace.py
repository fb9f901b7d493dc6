"""What a trace costs; plain `python benchmarks/bench_trace.py`.

Six records of data/undeclared against the whole library, wall and CPU time of the search itself (the bar: 10 s
on two cores), as a multiple of one refit without effects, for one and two threads; and a check that both give
the same answer. First the time of one flight of the filter, as a multiple of one recursion of `scipy.signal.dlsim` with as many
states, one set of derivatives of a record as a multiple of one flight (the bar: 5), and the screen of increments, as a
multiple of one flight for each bend.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
from scipy.signal import dlsim

from airtruth import aircraft
from airtruth.effects.registry import EFFECTS
from airtruth.logs.store import read_log
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import sensitivities_of
from airtruth.tracing.learning.increment_inputs import sensitivities_to
from airtruth.tracing.learning.increments import shapes
from airtruth.tracing.model.parameters import CORE, OUTPUTS, SHORT_PERIOD
from airtruth.tracing.model.response import filter_inputs, respond, respond_to
from airtruth.tracing.prepare import Case, prepare

FLIGHTS = 200
"""Flights of the filter that are timed."""
TURNS = 5
"""Turns of derivatives and flights, of which the quickest count."""
DATA = Path(__file__).resolve().parents[1] / "data" / "undeclared"


def flight(case: Case) -> str:
    """One flight of the filter against a linear recursion of the same length."""
    record, settings = case.fitted.records[0], case.fitted.settings
    point = initial_parameters(case.fitted, case.hypothesis)
    given = filter_inputs(record, case.hypothesis.change(point.sizes))
    start = time.perf_counter()
    for _ in range(FLIGHTS):
        respond_to(given, settings, np.zeros(SHORT_PERIOD.common.size), point.per_record[0])
    filtered = (time.perf_counter() - start) / FLIGHTS
    system = (0.9 * np.eye(CORE), np.ones((CORE, 1)), np.ones((OUTPUTS, CORE)), np.zeros((OUTPUTS, 1)), 1.0)
    inputs = np.ones((record.samples, 1))
    start = time.perf_counter()
    dlsim(system, inputs)
    linear = time.perf_counter() - start
    return f"one flight of the filter: {1e3 * filtered:.2f} ms of {record.samples} samples, {filtered / linear:.2f} of dlsim"


def derivatives(case: Case) -> str:
    """One set of derivatives of a record without effects against one flight of the filter with a gain of its own, CPU time."""
    problem, hypothesis, tries = case.fitted, case.hypothesis, FLIGHTS // 4
    point = initial_parameters(problem, hypothesis)
    given = filter_inputs(problem.records[0], hypothesis.change(point.sizes))
    sensitivities_of(problem, 0, hypothesis, point)  # compiles
    best = [np.inf, np.inf]
    for _ in range(TURNS):
        start = time.process_time()
        for _ in range(tries):
            sensitivities_of(problem, 0, hypothesis, point)
        middle = time.process_time()
        for _ in range(tries):
            respond_to(given, problem.settings, point.common, point.per_record[0])
        spent = middle - start, time.process_time() - middle
        best = [min(b, s / tries) for b, s in zip(best, spent, strict=True)]
    return f"one set of derivatives: {1e3 * best[0]:.2f} ms, {best[0] / best[1]:.1f} flights of the filter"


def screening(case: Case) -> str:
    """The screen of increments against as many flights of the filter, each with a gain of its own, as it has bends."""
    problem, hypothesis = case.fitted, case.hypothesis
    null = fit(problem, hypothesis, initial_parameters(problem, hypothesis))
    assert null is not None
    tried = shapes(problem)
    sensitivities_to(null, problem, tried)  # compiles
    start = time.perf_counter()
    made = sensitivities_to(null, problem, tried)
    screened = time.perf_counter() - start
    assert made is not None
    bends = len(made[0].t) - null.layout.total
    change = hypothesis.change(null.point.sizes)
    start = time.perf_counter()
    for _ in range(FLIGHTS):
        respond(problem.records[0], problem.settings, change, null.point.common, null.point.per_record[0])
    flown = (time.perf_counter() - start) / FLIGHTS * len(problem.records) * bends
    return f"screen of {bends} bends: {screened:.2f} s, {screened / flown:.2f} of a flight of the filter for each"


def main() -> None:
    """Print the table."""
    gtm = aircraft.load("gtm")
    trace([read_log(DATA / "f.parquet")], gtm, TraceOptions())  # compiles
    print(flight(prepare([read_log(DATA / "f.parquet")], gtm, [], TraceOptions())))
    print(derivatives(prepare([read_log(DATA / "f.parquet")], gtm, [], TraceOptions())))
    print(screening(prepare([read_log(DATA / "f.parquet")], gtm, [], TraceOptions())))
    print(f"{len(EFFECTS)} effects; s wall (CPU), refits without effects that would take as long")
    print(f"{'set':4} {'verdict':12} {'one thread':>18} {'two threads':>18} {'refits':>7} same answer")
    for path in sorted(DATA.glob("*.parquet")):
        log = read_log(path)
        answers, times = [], []
        for threads in (1, 2):
            wall, cpu = time.perf_counter(), time.process_time()
            answers.append(trace([log], gtm, TraceOptions(threads=threads)).to_dict())
            times.append((time.perf_counter() - wall, time.process_time() - cpu))
        case = prepare([log], gtm, list(EFFECTS.values()), TraceOptions())
        wall = time.perf_counter()
        fit(case.fitted, case.hypothesis, initial_parameters(case.fitted, case.hypothesis))
        refit = time.perf_counter() - wall
        same = json.dumps(answers[0]) == json.dumps(answers[1])
        one, two = (f"{w:.2f} ({c:.2f})" for w, c in times)
        print(
            f"{path.stem:4} {answers[0]['verdict']:12} {one:>18} {two:>18} {times[0][0] / refit:7.1f} {same}"
        )


if __name__ == "__main__":
    main()
