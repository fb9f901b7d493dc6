"""Estimates as the tables of pandas that statsmodels has: params, bse, conf_int, cov_params; and the tidy table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError
from airtruth.identification.estimates import Estimates, deviations, half_width, quantities

if TYPE_CHECKING:
    import pandas as pd


def params(estimates: Estimates) -> pd.DataFrame:
    """Derivatives [1/rad, rates as q c/(2V)]: a row for each run, a column for each derivative."""
    return _by_run(estimates, estimates.theta)


def bse(estimates: Estimates) -> pd.DataFrame:
    """Standard errors of `params`, in its units; NaN for a negative variance."""
    return _by_run(estimates, deviations(estimates))


def conf_int(estimates: Estimates, alpha: float = 0.05) -> pd.DataFrame:
    """Normal intervals of `params`: a row for each run and derivative, columns lower and upper.

    Parameters
    ----------
    estimates : of one method.
    alpha : probability outside of an interval [-].

    Raises
    ------
    ConfigurationError
        If alpha is not between 0 and 1.
    """
    import pandas as pd

    if not 0.0 < alpha < 1.0:
        raise ConfigurationError(f"conf_int: alpha {alpha}: must lie between 0 and 1, such as 0.05")
    half = half_width(1.0 - alpha) * deviations(estimates)
    ends = np.stack([estimates.theta - half, estimates.theta + half], axis=-1).reshape(-1, 2)
    return pd.DataFrame(ends, index=_both(estimates), columns=["lower", "upper"])


def cov_params(estimates: Estimates, run_id: str | None = None) -> pd.DataFrame:
    """Covariance of `params`, in the products of its units.

    Parameters
    ----------
    estimates : of one method.
    run_id : run whose matrix is returned; None for all runs, a row for each run and derivative.

    Raises
    ------
    ConfigurationError
        If the run is not among the estimates.
    """
    import pandas as pd

    names = list(estimates.motion.parameters)
    if run_id is None:
        rows = estimates.covariance.reshape(-1, len(names))
        return pd.DataFrame(rows, index=_both(estimates), columns=names)
    if run_id not in estimates.run_ids:
        raise ConfigurationError(
            f"run {run_id!r} is not among the {len(estimates.run_ids)} runs of these estimates, "
            f"the first of which is {estimates.run_ids[0]!r}"
        )
    return pd.DataFrame(
        estimates.covariance[estimates.run_ids.index(run_id)], index=pd.Index(names), columns=names
    )


def tidy(estimates: Sequence[Estimates]) -> pd.DataFrame:
    """One row for each method, run and quantity: method, run_id, parameter, unit, estimate, std, lower, upper, converged.

    Parameters
    ----------
    estimates : one for each method. Quantities are the derivatives and the modal parameters.
    """
    import pandas as pd

    parts = []
    for one in estimates:
        q = quantities(one)
        parts.append(
            pd.DataFrame(
                {
                    "method": one.method,
                    "run_id": np.repeat(np.array(one.run_ids, dtype=object), len(q.names)),
                    "parameter": list(q.names) * len(one.run_ids),
                    "unit": [one.motion.units[name] for name in q.names] * len(one.run_ids),
                    "estimate": q.value.ravel(),
                    "std": q.std.ravel(),
                    "lower": q.lower.ravel(),
                    "upper": q.upper.ravel(),
                    "converged": np.repeat(one.converged, len(q.names)),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def _by_run(estimates: Estimates, values: NDArray[np.float64]) -> pd.DataFrame:
    import pandas as pd

    index = pd.Index(estimates.run_ids, name="run_id")
    return pd.DataFrame(values, index=index, columns=list(estimates.motion.parameters))


def _both(estimates: Estimates) -> pd.MultiIndex:
    import pandas as pd

    return pd.MultiIndex.from_product(
        [estimates.run_ids, estimates.motion.parameters], names=["run_id", "parameter"]
    )


__all__ = ["bse", "conf_int", "cov_params", "params", "tidy"]
