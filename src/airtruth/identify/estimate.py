"""Identify: a batch or a log in, estimates out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from airtruth.identify.checks import check_batch, check_log
from airtruth.identify.condition import AircraftConstants
from airtruth.identify.methods import method, regression
from airtruth.identify.of_record import common, with_constants
from airtruth.identify.options import Options
from airtruth.identify.regression import regress_batch, regress_joint
from airtruth.identify.results import Estimates, estimates_table
from airtruth.logs.flight_log import Batch, FlightLog


def identify_batch(
    batch: Batch, constants: AircraftConstants, name: str, options: Options | None = None
) -> Estimates:
    """Estimate the six derivatives of each run; nothing is checked.

    A result does not depend on the other runs of the batch.

    Parameters
    ----------
    batch : runs of one length and sample period, as `airtruth.logs.flight_log.batches` makes them.
    constants : aircraft, any object with wing_area_m2, chord_m, mass_kg, inertia_yy_kg_m2.
    name : method, a key of `airtruth.identify.METHODS`.
    options : choices; None for the defaults.

    Raises
    ------
    ConfigurationError
        If the method does not exist.
    """
    options = options or Options()
    chosen = method(name)
    if chosen.estimate is not None:
        return chosen.estimate(batch, constants, options)
    return regress_batch(batch, constants, name, regression(chosen) if chosen.iterates else None, options)


def identify_joint(
    parts: Sequence[Batch], constants: AircraftConstants, name: str, options: Options | None = None
) -> Estimates:
    """One estimate for all runs together; nothing is checked.

    The normal equations of all runs are summed. Trim, flight condition and filters stay each run's own.
    All runs are held in memory.

    Parameters
    ----------
    parts : batches; lengths and rates may differ.
    constants, name, options : as in `identify_batch`.

    Raises
    ------
    ConfigurationError
        If the method does not exist.
    """
    options = options or Options()
    chosen = method(name)
    if chosen.estimate_joint is not None:
        return chosen.estimate_joint(parts, constants, options)
    return regress_joint(parts, constants, name, regression(chosen) if chosen.iterates else None, options)


def identify_log(
    log: FlightLog,
    constants: AircraftConstants,
    methods: Sequence[str] = ("iv-f1",),
    options: Options | None = None,
    joint: bool = False,
) -> pd.DataFrame:
    """Check a log, then estimate: one row per run and method, or per method if joint.

    Rows keep the order of the log's runs, and for each the order of the methods. Mass, inertia and reference
    lengths that the log states for a run (``record_constants``) count in place of those of ``constants``.

    Parameters
    ----------
    log : flight log; runs may differ in length and rate.
    constants, options : as in `identify_batch`.
    methods : names of methods.
    joint : whether all runs share one estimate.

    Raises
    ------
    ConfigurationError
        If a method does not exist or an option does not fit the log, or runs of a joint estimate state
        different constants.
    LogError
        Listing what is wrong with the log.
    """
    options = options or Options()
    chosen = [method(name) for name in methods]
    check_log(log, chosen, options)
    parts = list(with_constants(log, constants))
    for batch, _ in parts:
        check_batch(batch, options)
    if joint:
        one, together = common(parts), [batch for batch, _ in parts]
        tables = [estimates_table(identify_joint(together, one, m.name, options)) for m in chosen]
        return pd.concat(tables, ignore_index=True)
    tables = [
        estimates_table(identify_batch(batch, own, m.name, options)) for batch, own in parts for m in chosen
    ]
    table = pd.concat(tables, ignore_index=True)
    order = {run_id: i for i, run_id in enumerate(log.run_ids)}
    column = {m.name: i for i, m in enumerate(chosen)}
    rank = table["run_id"].map(order) * len(chosen) + table["method"].map(column)
    return table.iloc[np.argsort(rank.to_numpy(), kind="stable")].reset_index(drop=True)
