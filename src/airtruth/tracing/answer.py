"""The answer of a trace as JSON holds it: typed, immutable, and the same after a round trip through a file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, TypeGuard

from airtruth.channels import SIGNALS
from airtruth.errors import StoreError
from airtruth.physics.motion import Motion, motion_of
from airtruth.tracing.accepted import AcceptedEffect, ParameterEstimate, effect_key
from airtruth.tracing.stage_errors import COUNTS, AxialErrors, Errors, Replay, Tolerances

ANSWER: Final = "trace.json"
"""Name of the file in the folder of a trace."""
Z95: Final = 1.959964
"""Quantile 0.975 of the standard normal distribution, the half width of the intervals [standard deviations]."""

VerdictName = Literal["none", "traced", "one_of", "learned", "unexplained"]


def answer_path(trace: Path) -> Path:
    """The trace.json of a trace that is stated by its folder or by that file."""
    return trace / ANSWER if trace.is_dir() else trace


@dataclass(frozen=True)
class Evidence:
    """The strongest evidence of a missing effect.

    Attributes
    ----------
    statistic : chi-square statistic [-].
    p_value : probability of a larger statistic where nothing is missing, corrected for the number of tests [-].
    where : the effect or the omnibus test that shows it.
    """

    statistic: float
    p_value: float
    where: str = ""

    def to_dict(self) -> dict[str, float]:
        """Statistic and p-value."""
        return {"statistic": self.statistic, "p_value": self.p_value}


@dataclass(frozen=True)
class CandidateScore:
    """Score of one candidate at the aircraft without effects.

    Attributes
    ----------
    name, variant : of the effect.
    score, z : score statistic, chi-square with one degree of freedom [-], and its signed root.
    p_value, p_value_alone : with and without the correction for the number of candidates [-].
    testable : whether the records can test it.
    why_not : why it was not accepted; empty for an accepted effect and its equals.
    """

    name: str
    score: float
    p_value: float
    testable: bool
    why_not: str
    variant: str = ""
    z: float = 0.0
    p_value_alone: float = 1.0

    @property
    def key(self) -> str:
        """Name with the variant."""
        return effect_key(self.name, self.variant)

    def to_dict(self) -> dict[str, Any]:
        """Keys of trace.json."""
        order = ("name", "variant", "score", "z", "p_value", "p_value_alone", "testable", "why_not")
        channel = {"channel": self.variant} if self.variant in SIGNALS else {}
        return {name: getattr(self, name) for name in order} | channel


@dataclass(frozen=True)
class Derivatives:
    """Derivatives at the trim [1/rad, rates as q c/(2V)], name -> value: declared, refitted without and with the
    effects, and the standard deviation of the last.

    The slope of a learned increment at the trim adds to them; it belongs to the table of the increment.
    """

    declared: dict[str, float]
    before: dict[str, float]
    after: dict[str, float]
    after_std: dict[str, float]

    def to_dict(self) -> dict[str, dict[str, float]]:
        """The four rows."""
        return {f.name: dict(getattr(self, f.name)) for f in fields(self)}


@dataclass(frozen=True)
class DerivativeShift:
    """A derivative as declared and as the records have it [1/rad, rates as q c/(2V)].

    Attributes
    ----------
    declared, declared_std : declared value and its standard deviation, mass, inertia and CG included.
    estimate, std, ci95 : of the last fit, beside the accepted effects.
    sigma : distance of the two in declared standard deviations [-].
    """

    declared: float
    declared_std: float
    estimate: float
    std: float
    ci95: tuple[float, float]
    sigma: float

    def to_dict(self) -> dict[str, Any]:
        """Keys of trace.json."""
        return {f.name: _plain(getattr(self, f.name)) for f in fields(self)}


@dataclass(frozen=True)
class DeclaredModel:
    """Test of the declared model against the records.

    Attributes
    ----------
    consistent : whether the declared aircraft, within its declared uncertainty, flies the records.
    statistic, degrees : chi-square statistic of the stronger of two tests, of the derivatives and of everything else.
    p_value : probability of stronger evidence where the declaration is right, for both tests [-].
    shifts : derivative -> shift; where : what shows the statistic.
    """

    consistent: bool
    statistic: float
    degrees: int
    p_value: float
    shifts: dict[str, DerivativeShift]
    where: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Keys of trace.json."""
        return {f.name: _plain(getattr(self, f.name)) for f in fields(self)}


@dataclass(frozen=True)
class RefinedDerivative:
    """A derivative that the records determine better than the declaration does [1/rad, rates as q c/(2V)].

    Attributes
    ----------
    declared : declared value.
    estimate, std : of the records and the declaration together.
    """

    declared: float
    estimate: float
    std: float

    def to_dict(self) -> dict[str, float]:
        """Keys of trace.json."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass(frozen=True)
class Alternative:
    """A set of effects and its posterior weight among the sets that were compared [-]."""

    effects: tuple[str, ...]
    weight: float

    def to_dict(self) -> dict[str, Any]:
        """Keys of trace.json."""
        return {"effects": list(self.effects), "weight": self.weight}


@dataclass(frozen=True)
class RecordNames:
    """Names of the fitted and of the held-out records."""

    fitted: tuple[str, ...]
    held_out: tuple[str, ...]

    def to_dict(self) -> dict[str, list[str]]:
        """Both lists."""
        return {"fitted": list(self.fitted), "held_out": list(self.held_out)}


@dataclass(frozen=True)
class TraceAnswer:
    """The content of trace.json (docs/trace.md).

    Attributes
    ----------
    verdict : conclusion; provisional : whether there is a reservation, which the verdict in words or a note states.
    anomaly, remaining : strongest evidence of a missing effect, before any effect is accepted and with the accepted effects.
    effects : accepted effects, the most certain first by `separation_sigma`.
    candidates : every candidate, most significant first.
    error : root mean square errors of each stage, for the fitted and the held-out records; in `channels` the standard
        deviation of each channel. Stages *after* and *control* are absent if no effect is accepted.
    derivatives : at the trim [1/rad, rates as q c/(2V)]: `declared`, `before`, `after` and `after_std`.
    updated_aircraft : folder of the updated aircraft, None where none was written.
    detectability : effect -> smallest size that is material and that these records can trace, in the unit of its first
        parameter.
    next_flight : recommended next flight.
    model : "aircraft" or "linear"; records : names of the `fitted` and of the `held_out` records.
    notes : reservations and remarks, sentences without a final period.
    tolerances : free runs of each stage against the tolerances of a training simulator, with `source` and `limits`; None in
        old files.
    replay : root mean square errors of JSBSim with the `declared` and the `updated` aircraft; None where none was flown.
    forced : faults of the logs that the caller overrode (`--force`).
    declared_model : test of the declared model; None in old files.
    confirmed : whether the held-out records are no worse after than before; None where nothing can be compared.
    credit : effect -> log-likelihood of the held-out records that is lost without it, over the step from *declared* to
        *after* [-].
    alternatives : sets of effects, each with its posterior weight; inclusion : effect -> its probability.
    axial_force : errors of ax as declared, and with the increments of CX; None where ax was not compared.
    refined : derivative -> its refinement, where nothing is missing and the updated aircraft has the refined derivatives.
    """

    verdict: VerdictName
    provisional: bool
    anomaly: Evidence
    remaining: Evidence
    effects: tuple[AcceptedEffect, ...]
    candidates: tuple[CandidateScore, ...]
    error: Errors
    derivatives: Derivatives
    updated_aircraft: str | None
    detectability: dict[str, float]
    next_flight: str
    model: str
    records: RecordNames
    notes: tuple[str, ...] = ()
    tolerances: Tolerances | None = None
    replay: Replay | None = None
    forced: tuple[str, ...] = ()
    declared_model: DeclaredModel | None = None
    confirmed: bool | None = None
    alternatives: tuple[Alternative, ...] = ()
    inclusion: dict[str, float] = field(default_factory=dict)
    credit: dict[str, float] = field(default_factory=dict)
    axial_force: AxialErrors | None = None
    refined: dict[str, RefinedDerivative] = field(default_factory=dict)

    @property
    def motion(self) -> Motion:
        """The motion whose derivatives it states."""
        return motion_of(self.derivatives.declared)

    def __repr__(self) -> str:
        """Return verdict, effects and model in a line."""
        doubt = ", provisional" if self.provisional else ""
        named = ", ".join(effect_key(e.name, e.variant) for e in self.effects)
        return f"TraceAnswer({self.verdict}{doubt}: {named or 'no effect'}; model {self.model})"

    def to_dict(self) -> dict[str, Any]:
        """The content of trace.json."""
        found = {f.name: _plain(getattr(self, f.name)) for f in fields(self)}
        found["shown_by"] = {"anomaly": self.anomaly.where, "remaining": self.remaining.where}
        optional = {name for name in ("tolerances", "replay", "axial_force") if getattr(self, name) is None}
        optional |= set() if self.forced else {"forced"}
        return {name: value for name, value in found.items() if name not in optional}

    def to_json(self) -> str:
        """Text of trace.json."""
        return json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n"

    @classmethod
    def from_dict(cls, document: object, source: str = "the answer") -> TraceAnswer:
        """Read what `to_dict` makes; keys that this version does not know are passed over.

        Parameters
        ----------
        document : the decoded JSON.
        source : name of the file, for messages.

        Raises
        ------
        StoreError
            Naming the first key that is missing or has the wrong type.
        """
        from pydantic import TypeAdapter, ValidationError

        if not isinstance(document, Mapping) or "verdict" not in document:
            raise StoreError(f"{source}: is not the answer of a trace; run `airtruth trace` to write it")
        try:
            answer = TypeAdapter(cls).validate_python(_nested(document))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise StoreError(
                f"{source}: is not a complete answer of a trace ({where}: {first['msg'].lower()}); "
                "run `airtruth trace` again to write it"
            ) from None
        shown = document.get("shown_by")
        shown = shown if isinstance(shown, Mapping) else {}
        return replace(
            answer,
            anomaly=replace(answer.anomaly, where=str(shown.get("anomaly", ""))),
            remaining=replace(answer.remaining, where=str(shown.get("remaining", ""))),
        )

    @classmethod
    def read(cls, path: Path) -> TraceAnswer:
        """Read a trace.json.

        Raises
        ------
        StoreError
            If the file cannot be read or is not the answer of a trace.
        """
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise StoreError(
                f"{path}: cannot be read ({error}); run `airtruth trace` again to write it"
            ) from None
        return cls.from_dict(document, str(path))


def _nested(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document with its stages in a mapping of their own, as `Errors` and `Tolerances` hold them."""
    nested = dict(document)
    for name, rest in (("error", {"channels"}), ("tolerances", {"source", "limits", "modes"})):
        block = document.get(name)
        if isinstance(block, Mapping):
            stages = {stage: value for stage, value in block.items() if stage not in rest}
            if name == "tolerances":
                stages = {stage: _with_distances(value) for stage, value in stages.items()}
            nested[name] = {key: value for key, value in block.items() if key in rest} | {"stages": stages}
    return nested


def _with_distances(sets: Any) -> Any:
    """The sets of a stage with their distances in a mapping of their own, as `Excursions` holds them."""
    if not isinstance(sets, Mapping):
        return sets
    return {
        records: {key: own[key] for key in COUNTS if key in own}
        | {"distances": {key: value for key, value in own.items() if key not in COUNTS}}
        if isinstance(own, Mapping)
        else own
        for records, own in sets.items()
    }


def _plain(value: Any) -> Any:
    if _is_row(value):
        return value.to_dict()
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return {k: _plain(v) for k, v in value.items()} if isinstance(value, Mapping) else value


def _is_row(value: Any) -> TypeGuard[Any]:
    return is_dataclass(value) and hasattr(value, "to_dict")


__all__ = [
    "ANSWER",
    "Z95",
    "AcceptedEffect",
    "Alternative",
    "CandidateScore",
    "DeclaredModel",
    "DerivativeShift",
    "Derivatives",
    "Evidence",
    "ParameterEstimate",
    "RecordNames",
    "RefinedDerivative",
    "TraceAnswer",
    "VerdictName",
    "answer_path",
    "effect_key",
]
