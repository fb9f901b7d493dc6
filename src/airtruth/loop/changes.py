"""Every derivative by every method before and after, beside the same method on simulated records of the same inputs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import stdtrit

from airtruth.identification.result import IdentificationResult
from airtruth.physics.motion import motion_of

if TYPE_CHECKING:
    import pandas as pd

LEVEL: Final = 0.95
"""Level of the intervals of differences [-]; the convention of the package."""


@dataclass(frozen=True)
class DerivativeChange:
    """One derivative by one method, without and with the traced effects taken out.

    Attributes
    ----------
    method, derivative : names.
    declared : declared value [1/rad, rates as q c/(2V)].
    before, after : mean over the converged runs; NaN where none converged.
    before_error, after_error : standard error of the mean, from the scatter of the runs; of a single run, its own.
    runs_before, runs_after : number of converged runs.
    declared_same_inputs : mean of the method on the declared model, simulated without noise and gusts through the
        measured inputs of the compared runs; NaN where it was not simulated.
    corrected_same_inputs : the same of the corrected model, with the effects taken out as from the records.
    difference : mean over the runs of ``after`` less ``declared_same_inputs`` of the same run.
    difference_error : its standard error, from its scatter; of a single run, that of ``after``.
    remaining, remaining_error : the same less ``corrected_same_inputs``.
    runs_compared : number of runs in the two differences.
    """

    method: str
    derivative: str
    declared: float
    before: float
    before_error: float
    after: float
    after_error: float
    runs_before: int
    runs_after: int
    declared_same_inputs: float
    corrected_same_inputs: float
    difference: float
    difference_error: float
    remaining: float
    remaining_error: float
    runs_compared: int

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of ``difference``, by Student's t."""
        reach = quantile(self.runs_compared) * self.difference_error
        return self.difference - reach, self.difference + reach

    @property
    def differs(self) -> bool:
        """Whether the interval of ``difference`` excludes zero."""
        low, high = self.interval
        return low > 0.0 or high < 0.0

    @property
    def remains(self) -> bool:
        """Whether the 95 % interval of ``remaining`` excludes zero."""
        return abs(self.remaining) > quantile(self.runs_compared) * self.remaining_error


def quantile(runs: int) -> float:
    """Half width of a 95 % interval in standard errors: Student's t for a mean of runs, normal for a single run."""
    degrees = runs - 1 if runs > 1 else math.inf
    return float(stdtrit(degrees, 0.5 + 0.5 * LEVEL))


def changes_of(
    before: IdentificationResult,
    after: IdentificationResult,
    declared: Mapping[str, float],
    simulated: Mapping[str, IdentificationResult | None],
) -> tuple[DerivativeChange, ...]:
    """Return every derivative by every method.

    Parameters
    ----------
    before, after : estimates of the records.
    declared : derivative -> declared value.
    simulated : "declared" and "corrected" -> estimates of the simulated records; None where there are none.
    """
    names = motion_of(declared).parameters
    tables = {name: _converged(result, names) for name, result in simulated.items()}
    tables |= {"before": _converged(before, names), "after": _converged(after, names)}
    return tuple(
        _change(method, name, declared[name], {k: t[t["method"] == method] for k, t in tables.items()})
        for method in before.methods
        for name in names
    )


def _converged(result: IdentificationResult | None, names: Sequence[str]) -> pd.DataFrame:
    import pandas as pd

    if result is None:
        return pd.DataFrame({"method": [], "run_id": [], **{name: [] for name in names}})
    table = result.to_frame()
    return table[table["converged"]]


def _change(method: str, name: str, declared: float, own: Mapping[str, pd.DataFrame]) -> DerivativeChange:
    before, before_error = _mean(own["before"], name)
    after, after_error = _mean(own["after"], name)
    runs = [t.set_index("run_id")[name] for t in (own["after"], own["declared"], own["corrected"])]
    common = runs[0].index.intersection(runs[1].index).intersection(runs[2].index)
    measured, as_declared, as_corrected = (series.loc[common].to_numpy(dtype=np.float64) for series in runs)
    single = (
        float(own["after"].set_index("run_id")[f"{name}_std"].loc[common[0]]) if len(common) == 1 else 0.0
    )
    difference, difference_error = _with_error(measured - as_declared, single)
    remaining, remaining_error = _with_error(measured - as_corrected, single)
    return DerivativeChange(
        method=method,
        derivative=name,
        declared=declared,
        before=before,
        before_error=before_error,
        after=after,
        after_error=after_error,
        runs_before=len(own["before"]),
        runs_after=len(own["after"]),
        declared_same_inputs=_with_error(as_declared, 0.0)[0],
        corrected_same_inputs=_with_error(as_corrected, 0.0)[0],
        difference=difference,
        difference_error=difference_error,
        remaining=remaining,
        remaining_error=remaining_error,
        runs_compared=len(common),
    )


def _mean(table: pd.DataFrame, name: str) -> tuple[float, float]:
    """Mean over the runs and its standard error."""
    single = float(table[f"{name}_std"].iloc[0]) if len(table) == 1 else 0.0
    return _with_error(table[name].to_numpy(dtype=np.float64), single)


def _with_error(values: np.ndarray[tuple[int], np.dtype[np.float64]], single: float) -> tuple[float, float]:
    """Mean and standard error from the scatter; ``single`` is the standard error of a single value."""
    if len(values) == 0:
        return math.nan, math.nan
    if len(values) == 1:
        return float(values[0]), single
    return float(values.mean()), float(values.std(ddof=1) / math.sqrt(len(values)))


__all__ = ["LEVEL", "DerivativeChange", "changes_of", "quantile"]
