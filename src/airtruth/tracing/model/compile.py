"""Compile a `Change` into the arrays that the filter's kernel reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, get_args

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.sensor_errors import KINDS, Kind, SensorErrors
from airtruth.physics.terms import (
    DECLARED,
    READINGS,
    SHAPES,
    STATE_KINDS,
    AeroTerm,
    Change,
    ReadingTerm,
    SensorTerm,
    SurfaceTerm,
    declared_total,
    drivers_of,
    factors_of,
    signals_of,
)
from airtruth.tracing.model.kernel_input import EffectArrays
from airtruth.tracing.model.parameters import StateLayout, effect_states, state_layout

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CHANNELS: Final = READINGS
"""Outputs of the filter of the pitch plane, columns of the log."""


@dataclass(frozen=True)
class CompiledChange:
    """A change as arrays.

    Air terms are left out: the level of the vertical gust is each record's own, and the measured airspeed carries the
    horizontal one.

    Attributes
    ----------
    surface : of each control, terms between its reading and the air, `Change.surface_path`.
    effects : terms and states, for the filter's kernel.
    effect_states, motion : first state of each effect with states; states up to the last of them.
    declared : quantity of `airtruth.physics.terms.DECLARED` -> all its terms together.
    bias, scale, lag_s, delay_s, arm_m, down_m : (outputs,) [units of the outputs, -, s, s, m, m].
    inputs : channel of an input -> scale, bias and position error of its sensor.
    """

    surface: tuple[tuple[SurfaceTerm, ...], ...]
    effects: EffectArrays
    effect_states: Ints
    motion: int
    declared: Mapping[str, float]
    bias: Array
    scale: Array
    lag_s: Array
    delay_s: Array
    arm_m: Array
    down_m: Array
    inputs: Mapping[str, SensorErrors]

    def states(self, slow: bool) -> StateLayout:
        """States of the filter; ``slow``: the sensors have correlated noise."""
        return state_layout(self.effect_states, self.motion, self.lag_s, self.delay_s, slow)

    def undone(self, channel: str, x: Array) -> Array:
        """Readings of an input without the errors of its sensor [unit of the channel]."""
        errors = self.inputs.get(channel)
        return x if errors is None else errors.unscaled(x)


def compile_change(change: Change, motion: Motion = LONGITUDINAL) -> CompiledChange:
    """Resolve names to numbers.

    Parameters
    ----------
    motion : whose filter takes the change.

    Raises
    ------
    ConfigurationError
        If a term names a signal, shape or channel that the filter does not have, or two states have one name.
    """
    if change.derivatives:
        raise ConfigurationError(
            f"cause {change.derivatives[0].cause!r}: has to be resolved at a trim before the filter takes it"
        )
    for shifted in change.declared:
        _index(shifted.quantity, tuple(DECLARED), "declared quantity")
    first, states = effect_states([s.kind for s in change.states], motion)
    channels = motion.output_channels
    outputs = {kind: np.full(len(channels), KINDS[kind].neutral) for kind in get_args(Kind)}
    late = {(control.channel, "delay") for control in motion.controls}
    inputs: dict[str, SensorErrors] = {}
    for sensor in change.sensors:
        if sensor.channel in channels:
            at = channels.index(sensor.channel)
            of_kind = outputs[sensor.kind]
            of_kind[at] = KINDS[sensor.kind].combined(float(of_kind[at]), sensor.value)
        elif (sensor.channel, sensor.kind) not in late:
            inputs[sensor.channel] = _with_error(inputs.get(sensor.channel, SensorErrors()), sensor)
    return CompiledChange(
        surface=tuple(change.surface_path(control) for control in motion.controls),
        effects=_effects(change, first, motion),
        effect_states=first,
        motion=states,
        declared={quantity: declared_total(change.declared, quantity) for quantity in DECLARED},
        bias=outputs["bias"],
        scale=outputs["scale"],
        lag_s=np.maximum(outputs["lag"], 0.0),
        delay_s=outputs["delay"],
        arm_m=outputs["arm"],
        down_m=outputs["arm_down"],
        inputs=inputs,
    )


def _effects(change: Change, first: Ints, motion: Motion) -> EffectArrays:
    """Terms of coefficients and readings, and states, by numbers; ``first``: first state of each effect with states."""
    names = [s.name for s in change.states]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ConfigurationError(
            f"effect: two states are named {twice.pop()!r}; an effect with a state can be added once"
        )
    signals, factors = signals_of(motion), factors_of(motion)
    targets = (*(c.name for c in motion.coefficients), *motion.output_channels)
    # the airspeed is measured, so that an axial force moves no output of the filter
    stated: list[AeroTerm | ReadingTerm] = [t for t in change.aero if t.coefficient != "CX"]
    every = [t for t in (*stated, *change.readings) if t.amplitude != 0.0]
    terms = np.zeros((len(every), 6), dtype=np.int64)
    for i, term in enumerate(every):
        acts_on = term.channel if isinstance(term, ReadingTerm) else term.coefficient
        signal = _index(term.signal, (*signals, *names), "signal")
        own = signal >= len(signals)
        terms[i] = (
            _index(acts_on, targets, "coefficient or channel"),
            -1 if own else signal,
            _index(term.shape, SHAPES, "shape"),
            first[signal - len(signals)] if own else -1,
            -1,
            -1,
        )
        if isinstance(term, AeroTerm) and term.factor:
            _index(term.factor, factors, "factor")
            terms[i, 4] = signals.index(term.factor)
        if isinstance(term, ReadingTerm) and term.behind:
            terms[i, 5] = _index(term.behind, tuple(names), "state")
    states = np.zeros((len(change.states), 2), dtype=np.int64)
    for i, state in enumerate(change.states):
        allowed = factors if state.kind == "play" else drivers_of(motion)
        states[i] = _index(state.kind, STATE_KINDS, "state"), _index(state.signal, allowed, "signal")
    return EffectArrays(
        term_index=terms,
        amplitude=np.array([t.amplitude for t in every], dtype=np.float64),
        origin=np.array([t.at for t in every], dtype=np.float64),
        factor_origin=np.array([getattr(t, "factor_at", 0.0) for t in every], dtype=np.float64),
        state_index=states,
        time_s=np.array([s.time_s for s in change.states], dtype=np.float64),
        damping=np.array([s.damping for s in change.states], dtype=np.float64),
        half_width=np.array([s.half_width for s in change.states], dtype=np.float64),
    )


def _with_error(errors: SensorErrors, term: SensorTerm) -> SensorErrors:
    """Errors of an input's sensor with one more."""
    if term.kind == "scale":
        return replace(errors, scale=errors.scale * term.value)
    if term.kind == "bias":
        return replace(errors, bias=errors.bias + term.value)
    if term.kind == "alpha_slope" and term.channel == "airspeed_m_s":
        return replace(errors, alpha_slope_per_rad=errors.alpha_slope_per_rad + term.value)
    if term.kind == "arm_right":
        return replace(errors, y_m=errors.y_m + term.value)
    known = ("bias", "scale", "arm_right", "alpha_slope of airspeed_m_s")
    raise ConfigurationError(f"effect on {term.channel}: {term.kind!r}; {choices(term.kind, known)}")


def _index(name: str, allowed: tuple[str, ...], what: str) -> int:
    if name not in allowed:
        raise ConfigurationError(f"effect: {what} {name!r}: {choices(name, allowed)}")
    return allowed.index(name)
