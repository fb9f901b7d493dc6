"""The estimators by name, with what each needs and where it is defined.

Source of all: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.identify.actuator import estimated_elevator
from airtruth.identify.dynamic import dynamic_problem, f1_numerator, f2_numerator
from airtruth.identify.lowpass import iv_problem, ls_problem
from airtruth.identify.options import Options
from airtruth.identify.problem import Observation, Problem

Array = NDArray[np.float64]

COMMAND: Final = "elevator_command_rad"


@dataclass(frozen=True)
class Method:
    """An estimator.

    Attributes
    ----------
    name : what --method takes.
    title : how tables print it.
    source : equations of the paper.
    pose : (observation, options) -> the regression that the iteration solves.
    iterates : whether the instruments depend on theta; otherwise one solution is all.
    channels : columns needed besides those that every log has.
    """

    name: str
    title: str
    source: str
    pose: Callable[[Observation, Options], Problem]
    iterates: bool = True
    channels: tuple[str, ...] = ()


def _command(observation: Observation) -> Array:
    if observation.command is None:
        raise ValueError(f"the observation holds no {COMMAND}")
    return observation.command


def _none_failed(observation: Observation) -> NDArray[np.bool_]:
    return np.zeros(observation.signals.shape[0], dtype=np.bool_)


def _lowpass(o: Observation, options: Options) -> Problem:
    return iv_problem(o, options, o.smooth[:, 3], None, _none_failed(o))


def _reference(o: Observation, options: Options) -> Problem:
    return iv_problem(o, options, _command(o), None, _none_failed(o))


def _reference_regressor(o: Observation, options: Options) -> Problem:
    return iv_problem(o, options, _command(o), _command(o), _none_failed(o))


def _actuator(o: Observation, options: Options) -> Problem:
    u, failed = estimated_elevator(_command(o), o.signals[:, 3], o.dt_s)
    return iv_problem(o, options, u, None, failed)


def _actuator_regressor(o: Observation, options: Options) -> Problem:
    u, failed = estimated_elevator(_command(o), o.signals[:, 3], o.dt_s)
    return iv_problem(o, options, u, u, failed)


def _f1(o: Observation, options: Options) -> Problem:
    return dynamic_problem(o, options, f1_numerator)


def _f2(o: Observation, options: Options) -> Problem:
    return dynamic_problem(o, options, f2_numerator)


METHODS: Final[dict[str, Method]] = {
    m.name: m
    for m in (
        Method("ls", "LS", "eq. (5)", ls_problem, iterates=False),
        Method("iv-lowpass", "IV(de_f)", "eq. (9), IV.B", _lowpass),
        Method("iv-reference", "IV(de_r)", "eq. (9), IV.B", _reference, channels=(COMMAND,)),
        Method(
            "iv-reference-regressor",
            "IV(de_r), in X too",
            "eq. (9), IV.B",
            _reference_regressor,
            channels=(COMMAND,),
        ),
        Method("iv-actuator", "IV(de_hat)", "eq. (9), IV.B", _actuator, channels=(COMMAND,)),
        Method(
            "iv-actuator-regressor",
            "IV(de_hat), in X too",
            "eq. (9), IV.B",
            _actuator_regressor,
            channels=(COMMAND,),
        ),
        Method("iv-f1", "IV(f1)", "eqs (7), (9), (11)", _f1),
        Method("iv-f2", "IV(f2)", "eqs (8), (9), (11)", _f2),
    )
}


def method(name: str) -> Method:
    """The estimator of that name.

    Raises
    ------
    ConfigurationError
        If there is none; the message lists those that exist.
    """
    if name not in METHODS:
        raise ConfigurationError(f"method {name!r} does not exist: {choices(name, METHODS)}")
    return METHODS[name]
