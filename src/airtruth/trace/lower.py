"""From a `Change` to the arrays that the filter's kernel reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.change import SHAPES, SIGNALS, Change, SurfaceTerm
from airtruth.errors import ConfigurationError, choices

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CHANNELS: Final = ("alpha_rad", "q_rad_s", "az_m_s2")
"""Outputs of the filter, columns of the log."""
_DECLARED: Final = ("mass", "inertia", "elevator", "cg", "thrust_arm")


@dataclass(frozen=True)
class Lowered:
    """A change as arrays; see `airtruth.trace.kernel` for their meaning.

    Its air terms are left out: the level of the gust is each record's own, and the measured airspeed
    carries the horizontal one.

    Attributes
    ----------
    surface : terms between the measured surface and the air.
    aero_index, aero_value : (terms, 3) coefficient, signal, shape; (terms, 2) amplitude, origin.
    state_index, state_value : (states, 2) kind, signal; (states, 2) time [s], damping.
    declared : (5,) factors of mass, inertia, elevator; CG shift [chords]; thrust arm [m].
    bias, scales, lags, delays, arms : (3,) of the outputs.
    input_scale, input_bias : channel of an input -> what its sensor does.
    """

    surface: tuple[SurfaceTerm, ...]
    aero_index: Ints
    aero_value: Array
    state_index: Ints
    state_value: Array
    declared: Array
    bias: Array
    scales: Array
    lags: Array
    delays: Array
    arms: Array
    input_scale: dict[str, float]
    input_bias: dict[str, float]


def lower(change: Change) -> Lowered:
    """Resolve names to numbers.

    Raises
    ------
    ConfigurationError
        If a term names a signal, shape or channel that the filter does not have.
    """
    names = [s.name for s in change.states]
    signals = (*SIGNALS, *names)
    aero_index = np.zeros((len(change.aero), 3), dtype=np.int64)
    aero_value = np.zeros((len(change.aero), 2))
    for i, term in enumerate(change.aero):
        aero_index[i] = (
            _index(term.coefficient, ("CL", "Cm"), "coefficient"),
            _index(term.signal, signals, "signal"),
            _index(term.shape, SHAPES, "shape"),
        )
        if aero_index[i, 1] >= len(SIGNALS):  # the place of a state, not its number
            before = change.states[: aero_index[i, 1] - len(SIGNALS)]
            aero_index[i, 1] = len(SIGNALS) + sum(1 if s.kind == "lag" else 2 for s in before)
        aero_value[i] = (term.amplitude, term.at)
    state_index = np.zeros((len(change.states), 2), dtype=np.int64)
    state_value = np.zeros((len(change.states), 2))
    for i, state in enumerate(change.states):
        state_index[i] = (
            _index(state.kind, ("lag", "mode"), "state"),
            _index(state.signal, SIGNALS, "signal"),
        )
        state_value[i] = (state.time_s, state.damping)
    declared = np.array([1.0, 1.0, 1.0, 0.0, 0.0])
    for shifted in change.declared:
        at = _index(shifted.quantity, _DECLARED, "declared quantity")
        declared[at] = declared[at] * shifted.value if at < 3 else declared[at] + shifted.value
    sensors = {kind: np.zeros(3) for kind in ("bias", "lag", "delay", "arm")} | {"scale": np.ones(3)}
    scale: dict[str, float] = {}
    bias: dict[str, float] = {}
    for sensor in change.sensors:
        if sensor.channel in CHANNELS:
            at = CHANNELS.index(sensor.channel)
            if sensor.kind == "scale":
                sensors["scale"][at] *= sensor.value
            else:
                sensors[sensor.kind][at] += sensor.value
        elif sensor.kind == "scale":
            scale[sensor.channel] = scale.get(sensor.channel, 1.0) * sensor.value
        elif sensor.kind == "bias":
            bias[sensor.channel] = bias.get(sensor.channel, 0.0) + sensor.value
        else:
            raise ConfigurationError(
                f"effect on {sensor.channel}: {sensor.kind!r}; {choices(sensor.kind, ('bias', 'scale'))}"
            )
    return Lowered(
        surface=change.surface,
        aero_index=aero_index,
        aero_value=aero_value,
        state_index=state_index,
        state_value=state_value,
        declared=declared,
        bias=sensors["bias"],
        scales=sensors["scale"],
        lags=np.maximum(sensors["lag"], 0.0),
        delays=sensors["delay"],
        arms=sensors["arm"],
        input_scale=scale,
        input_bias=bias,
    )


def _index(name: str, allowed: tuple[str, ...], what: str) -> int:
    if name not in allowed:
        raise ConfigurationError(f"effect: {what} {name!r}: {choices(name, allowed)}")
    return allowed.index(name)
