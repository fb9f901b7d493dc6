"""The estimators by name, each with its source and the channels that it needs.

Source of all: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification".
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.arguments import names
from airtruth.errors import ConfigurationError, choices
from airtruth.identification.condition import AircraftConstants, Observation, OneOrEach
from airtruth.identification.estimates import Estimates
from airtruth.identification.lateral.methods import ESTIMATORS
from airtruth.identification.likelihood.method import (
    estimate_filter_error,
    estimate_output_error,
    joint_filter_error,
    joint_output_error,
)
from airtruth.identification.options import Options
from airtruth.identification.regression import frequency, frequency_iv, refined
from airtruth.identification.regression.dynamic import dynamic_problem, f1_numerator, f2_numerator
from airtruth.identification.regression.kalman_instruments import deviation, predictions
from airtruth.identification.regression.lowpass import estimated_elevator, iv_problem, ls_problem
from airtruth.identification.regression.rows import Problem
from airtruth.identification.signals import COMMAND, ELEVATOR
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Method:
    """An estimator: a regression for the common iteration, or functions of its own.

    Attributes
    ----------
    name : value of --method.
    title : name in tables.
    source : equations of the paper, or another source.
    pose : (observation, options) -> the regression that the iteration solves; None where the method
        estimates by itself.
    estimate : (batch, constants, options) -> estimates of each run; instead of ``pose``.
    estimate_joint : (batches, constants, options) -> one estimate for all runs; goes with ``estimate``.
    iterates : whether the instruments depend on theta; otherwise the regression is solved once.
    channels : columns needed in addition to those that every log has.
    """

    name: str
    title: str
    source: str
    pose: Callable[[Observation, Options], Problem] | None = None
    estimate: Callable[[Batch, AircraftConstants, Options], Estimates] | None = None
    estimate_joint: Callable[[Sequence[Batch], OneOrEach, Options], Estimates] | None = None
    iterates: bool = True
    channels: tuple[str, ...] = ()


def _command(observation: Observation) -> Array:
    if observation.command is None:
        raise ValueError(f"the observation holds no {COMMAND}")
    return observation.command


def _none_failed(observation: Observation) -> NDArray[np.bool_]:
    return np.zeros(observation.signals.shape[0], dtype=np.bool_)


def _lowpass(o: Observation, options: Options) -> Problem:
    return iv_problem(o, options, o.smooth[:, ELEVATOR], None, _none_failed(o))


def _reference(o: Observation, options: Options) -> Problem:
    return iv_problem(o, options, _command(o), None, _none_failed(o))


def _reference_regressor(o: Observation, options: Options) -> Problem:
    return iv_problem(o, options, _command(o), _command(o), _none_failed(o))


def _actuator(o: Observation, options: Options) -> Problem:
    u, failed = estimated_elevator(_command(o), o.signals[:, ELEVATOR], o.dt_s)
    return iv_problem(o, options, u, None, failed)


def _actuator_regressor(o: Observation, options: Options) -> Problem:
    u, failed = estimated_elevator(_command(o), o.signals[:, ELEVATOR], o.dt_s)
    return iv_problem(o, options, u, u, failed)


def _kalman(o: Observation, options: Options) -> Problem:
    if options.auxiliary is not None:
        raise ConfigurationError(
            "method iv-kalman makes its instruments by a Kalman filter and uses no auxiliary model: leave the option "
            "auxiliary out, or use iv-f1"
        )
    elevator = deviation(o)

    def instruments(theta: Array, active: NDArray[np.int64]) -> Array:
        return predictions(o, elevator, theta, active)

    return iv_problem(o, options, o.smooth[:, ELEVATOR], None, _none_failed(o), instruments)


def _f1(o: Observation, options: Options) -> Problem:
    return dynamic_problem(o, options, f1_numerator)


def _f2(o: Observation, options: Options) -> Problem:
    return dynamic_problem(o, options, f2_numerator)


OWN: Final[dict[str, Method]] = {
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
        Method("iv-kalman", "IV(Kalman)", "Klein, AGARD-LS-104, 1979", _kalman),
        Method("iv-f1", "IV(f1)", "eqs (7), (9), (11)", _f1),
        Method("iv-f2", "IV(f2)", "eqs (8), (9), (11)", _f2),
        Method(
            "iv-refined",
            "IV refined",
            "eq. (4); P. C. Young, 2011, ch. 7",
            estimate=refined.estimate,
            estimate_joint=refined.estimate_joint,
        ),
        Method(
            "frequency",
            "Frequency",
            "Klein and Morelli, 2006, 7.2",
            estimate=frequency.estimate,
            estimate_joint=frequency.estimate_joint,
        ),
        Method(
            "iv-frequency",
            "IV frequency",
            "Larsson and Enqvist, SYSID 2012",
            estimate=frequency_iv.estimate,
            estimate_joint=frequency_iv.estimate_joint,
        ),
        Method(
            "filter-error",
            "Filter error",
            "Maine and Iliff, NASA RP-1138",
            estimate=estimate_filter_error,
            estimate_joint=joint_filter_error,
        ),
        Method(
            "output-error",
            "Output error",
            "Maine and Iliff, NASA RP-1138",
            estimate=estimate_output_error,
            estimate_joint=joint_output_error,
        ),
    )
}
"""The estimators of airtruth by name."""
GROUP: Final = "airtruth.methods"
"""Group of the entry points by which other packages add estimators."""


def merged(own: Mapping[str, Method], others: Iterable[EntryPoint]) -> dict[str, Method]:
    """Return estimators by name, those of entry points last.

    A package adds an estimator by an entry point whose object is a `Method` or an iterable of them; in its pyproject.toml:

        [project.entry-points."airtruth.methods"]
        ridge = "my_package.ridge:METHOD"

    Raises
    ------
    ConfigurationError
        If an entry point provides anything else, or a name that exists.
    """
    result = dict(own)
    for point in others:
        loaded = point.load()
        where = f"entry point {point.name} = {point.value} in {GROUP}"
        for one in (loaded,) if isinstance(loaded, Method) else loaded:
            if not isinstance(one, Method):
                raise ConfigurationError(
                    f"{where} gives {type(one).__name__}; it has to be an airtruth.identification.Method or an iterable of them"
                )
            if one.name in result:
                raise ConfigurationError(
                    f"{where}: a method {one.name!r} exists already; choose another name"
                )
            result[one.name] = one
    return result


METHODS: Final[dict[str, Method]] = merged(OWN, entry_points(group=GROUP))
"""The estimators by name, with those of other packages."""


LATERAL_METHODS: Final[dict[str, Method]] = {
    name: Method(name, own.title, own.source, estimate=own.estimate, estimate_joint=own.estimate_joint)
    for name, own in ESTIMATORS.items()
}
"""The estimators of the lateral-directional motion by name."""
OF_MOTION: Final[Mapping[str, Mapping[str, Method]]] = {
    LONGITUDINAL.name: METHODS,
    LATERAL.name: LATERAL_METHODS,
}
"""Estimators by the name of the motion."""
DEFAULT: Final[Mapping[str, str]] = {LONGITUDINAL.name: "iv-f1", LATERAL.name: "iv-lowpass"}
"""Estimator that is used where none is named, by the name of the motion."""


def title(name: str) -> str:
    """Name of an estimator in tables; of one that is not in `METHODS`, the name itself."""
    return METHODS[name].title if name in METHODS else name


def chosen_methods(
    given: str | Method | Iterable[str | Method], motion: Motion = LONGITUDINAL
) -> list[Method]:
    """Return the estimators of a motion by names or `Method` objects, each once.

    Raises
    ------
    ConfigurationError
        If one does not exist or is neither, or two that differ have one name.
    """
    if not isinstance(given, str | Method | Iterable):
        names("methods", given, "ls")
    each = (given,) if isinstance(given, str | Method) else tuple(given)
    plain = iter(names("methods", [one for one in each if not isinstance(one, Method)], "ls"))
    result: dict[str, Method] = {}
    for one in each:
        found = method(one if isinstance(one, Method) else next(plain), motion)
        if result.setdefault(found.name, found) != found:
            raise ConfigurationError(f"methods: two methods have the name {found.name!r}; rename one")
    return list(result.values())


def regression(chosen: Method) -> Callable[[Observation, Options], Problem]:
    """Return the function that makes the method's regression.

    Raises
    ------
    ConfigurationError
        If the method solves none.
    """
    if chosen.pose is None:
        others = ", ".join(m.name for m in METHODS.values() if m.pose is not None)
        raise ConfigurationError(
            f"method {chosen.name} solves no filtered regression, so that it has no diagnostics; "
            f"use one of {others}"
        )
    return chosen.pose


def method(name: str | Method, motion: Motion = LONGITUDINAL) -> Method:
    """The estimator of a motion of that name; a `Method` is returned as it is.

    Raises
    ------
    ConfigurationError
        If there is none; the message lists those that exist. If a `Method` has the name of another one in `METHODS`.
    """
    known = OF_MOTION[motion.name]
    if isinstance(name, Method):
        if known.get(name.name, name) != name:
            raise ConfigurationError(f"a method {name.name!r} exists already; choose another name")
        return name
    if name not in known:
        missing = f"does not exist for the {motion.name} motion" if name in METHODS else "does not exist"
        raise ConfigurationError(f"method {name!r} {missing}: {choices(name, known)}")
    return known[name]
