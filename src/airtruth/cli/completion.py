"""Words that a shell completes: names of aircraft, methods, effects and examples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

METHOD_NAMES: Final = (
    *("ls", "iv-lowpass", "iv-reference", "iv-reference-regressor", "iv-actuator", "iv-actuator-regressor"),
    *(
        "iv-kalman",
        "iv-f1",
        "iv-f2",
        "iv-refined",
        "frequency",
        "iv-frequency",
        "filter-error",
        "output-error",
    ),
)
"""Choices of --method, those of `airtruth.identification.METHODS`."""


def complete_aircraft(incomplete: str) -> Iterator[str]:
    """Names of the shipped aircraft, and folders that hold aircraft.toml."""
    from pathlib import Path

    from airtruth.aircraft.file import FILE
    from airtruth.aircraft.loading import shipped_roots

    names = {file.parent.name for root in shipped_roots() for file in root.glob(f"*/{FILE}")}
    folders = {str(file.parent) for file in Path().glob(f"*/{FILE}")}
    return _beginning(incomplete, {*names, *folders})


def complete_method(incomplete: str) -> Iterator[str]:
    """Names of the estimators."""
    return _beginning(incomplete, METHOD_NAMES)


def complete_effect(incomplete: str) -> Iterator[str]:
    """Names and keys of the effects."""
    from airtruth.effects.registry import EFFECTS

    return _beginning(incomplete, {*EFFECTS, *(effect.name for effect in EFFECTS.values())})


def complete_derivative(incomplete: str) -> Iterator[str]:
    """Names of the derivatives; after a comma the next one."""
    from airtruth.physics.motion import LONGITUDINAL

    before, comma, last = incomplete.rpartition(",")
    stated = before.split(",")
    return (before + comma + name for name in _beginning(last, LONGITUDINAL.parameters) if name not in stated)


def complete_example(incomplete: str) -> Iterator[str]:
    """Names of the examples."""
    from airtruth.starting import EXAMPLES

    return _beginning(incomplete, EXAMPLES)


def _beginning(incomplete: str, names: Iterable[str]) -> Iterator[str]:
    return (name for name in sorted(names) if name.startswith(incomplete))
