"""What a check of kinematics answers: findings, causes, and sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from airtruth.identify.kinematics_model import ERRORS
from airtruth.identify.summary import Cell, Table


@dataclass(frozen=True)
class Finding:
    """An instrument error with its uncertainty.

    Attributes
    ----------
    name, unit, meaning : which error.
    value, std, lower, upper : estimate, standard error, 95 % interval [unit].
    declared : what the aircraft file says, or no error.
    seen : whether the records show it; if not, the figures are not to be relied on.
    """

    name: str
    unit: str
    meaning: str
    value: float
    std: float
    lower: float
    upper: float
    declared: float
    seen: bool


@dataclass(frozen=True)
class Cause:
    """One explanation of alpha against q and az: a cause, and the scale of alpha fitted with it.

    Attributes
    ----------
    cause : the finding; None stands for no cause but a scale.
    alpha_scale : the scale that goes with it.
    statistic, degrees : motion caused by the elevator that it leaves unexplained, about chi-square.
    distance : statistic over that of the best cause, scaled so that what the best leaves counts as
        noise, and the improbability of the scale added; as a difference of 2 log likelihood.
    possible : whether it is within `CLASS` of the best.
    """

    cause: Finding | None
    alpha_scale: Finding
    statistic: float
    degrees: int
    distance: float
    possible: bool

    @property
    def name(self) -> str:
        """Name of the cause, "none" without one."""
        return self.cause.name if self.cause else "none"


@dataclass(frozen=True)
class Consistency:
    """What the kinematics of a log say of its instruments.

    Attributes
    ----------
    run_ids : runs that were judged, together.
    findings : scales, delays and biases that one equation each shows.
    causes : explanations of alpha against q and az, the best first.
    residual_rms : channel -> rms of what stays unexplained: air that moves, noise [unit of the channel].
    sentences : what is wrong, what cannot be told apart, what is missing, in words.
    """

    run_ids: tuple[str, ...]
    findings: tuple[Finding, ...]
    causes: tuple[Cause, ...]
    residual_rms: Mapping[str, float]
    sentences: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """Plain values, for JSON."""
        return asdict(self)


def sentences_of(findings: Sequence[Finding], causes: Sequence[Cause]) -> list[str]:
    """What findings and causes mean, in words."""
    result = []
    for one in findings:
        if not one.seen:
            result.append(f"{one.name}: the records do not show it.")
        elif one.name in ERRORS and not one.lower <= one.declared <= one.upper:
            result.append(f"{one.name} is {shown(one)}, where {one.declared:g} {one.unit} is declared.")
    possible = [c for c in causes if c.possible]
    names = [c.name for c in possible]
    scale = possible[0].alpha_scale
    if "none" in names:
        result.append(
            "alpha agrees with q and az in time: no arm, lag or delay beyond the declared ones is needed."
        )
        none = next(c for c in possible if c.name == "none")
        scale = none.alpha_scale
    elif len(possible) == 1:
        cause = possible[0].cause
        assert cause is not None
        result.append(f"alpha against q and az: {cause.name} {shown(cause)}; the other causes are excluded.")
    else:
        options = " or ".join(
            f"{c.cause.name} {shown(c.cause)} (alpha_scale {c.alpha_scale.value:.3f})"
            for c in possible
            if c.cause
        )
        result.append(
            f"alpha against q and az: {options}: these records do not tell them apart; "
            "a surveyed position, or a known scale, does."
        )
    if scale.seen and not scale.lower <= scale.declared <= scale.upper:
        result.append(
            f"alpha_scale is {shown(scale)} with {possible[0].name if 'none' not in names else 'no cause'}, "
            f"where {scale.declared:g} is declared; the inverse scale on q and az together would do the same."
        )
    return result


def shown(one: Finding) -> str:
    """ "13.1 +- 0.2 m", digits by the standard error."""
    digits = int(np.clip(1 - np.floor(np.log10(max(one.std, 1e-12))), 0, 8))
    unit = "" if one.unit == "-" else f" {one.unit}"
    return f"{one.value:.{digits}f} +- {one.std:.{digits}f}{unit}"


def tables(result: Consistency) -> tuple[Table, Table]:
    """Findings, and causes of a disagreement of alpha, as tables for people."""
    rows: list[tuple[Cell, ...]] = [
        (f.name, f.unit, f.value, f.std, f.lower, f.upper, f.declared, "yes" if f.seen else "no")
        for f in result.findings
    ]
    found = Table(
        title=f"Kinematic consistency of {len(result.run_ids)} run{'s' * (len(result.run_ids) > 1)}, 95 % intervals",
        columns=("quantity", "unit", "estimate", "std", "lower", "upper", "declared", "shown"),
        rows=tuple(rows),
        notes=tuple(f"{f.name}: {f.meaning}" for f in result.findings),
    )
    rows = []
    for c in result.causes:
        cause: tuple[Cell, ...] = ("-", float("nan"), float("nan"))
        if c.cause is not None:
            cause = (c.cause.unit, c.cause.value, c.cause.std)
        verdict = "possible" if c.possible else "excluded"
        rows.append(
            (
                c.name,
                *cause,
                c.alpha_scale.value,
                c.alpha_scale.std,
                c.statistic,
                c.degrees,
                c.distance,
                verdict,
            )
        )
    causes = Table(
        title="Single causes of alpha against q and az, the best first",
        columns=(
            "cause",
            "unit",
            "estimate",
            "std",
            "alpha scale",
            "std",
            "unexplained",
            "degrees",
            "distance",
            "verdict",
        ),
        rows=tuple(rows),
        notes=result.sentences,
    )
    return found, causes


__all__ = ["Cause", "Consistency", "Finding", "sentences_of", "shown", "tables"]
