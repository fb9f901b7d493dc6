"""What a campaign folder holds for the tables: the truth of each run and the estimates of each method.

The truth is for tables and scoring alone; nothing here is read by identify or trace.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from airtruth.errors import LogError, StoreError, choices
from airtruth.report.published import ESTIMATED

Array = NDArray[np.float64]

TRUTH: Final = "truth.parquet"
ESTIMATES: Final = "estimates.parquet"
DESCRIPTION: Final = "campaign.json"
FLOWN: Final = "ok"
FAILED: Final = "failed"


@dataclass(frozen=True)
class MethodEstimates:
    """Estimates of one method; rows follow `Campaign.run_ids`, NaN where a run did not fly.

    Attributes
    ----------
    values, lower, upper : (runs, 8) six derivatives [-], wn [rad/s], zeta [-], and interval bounds.
    converged : (runs,) whether the method converged.
    iterations : (runs,) number of iterations.
    status : (runs,) how the method says that it ended.
    """

    values: Array
    lower: Array
    upper: Array
    converged: NDArray[np.bool_]
    iterations: Array
    status: tuple[str, ...]


@dataclass(frozen=True)
class Campaign:
    """A flown and identified campaign.

    Attributes
    ----------
    folder : where it was read from.
    name, title : short name and heading.
    gust : what campaign.json says of the gusts, empty if nothing.
    run_ids : planned runs.
    flown : (runs,) whether the run has a log.
    truth : (runs, 8) truth of each run, NaN where it did not fly.
    estimates : method -> estimates.
    """

    folder: Path
    name: str
    title: str
    gust: Mapping[str, object]
    run_ids: tuple[str, ...]
    flown: NDArray[np.bool_]
    truth: Array
    estimates: Mapping[str, MethodEstimates]


def read_campaign(folder: Path) -> Campaign:
    """Read the truth and the estimates of a campaign folder.

    Raises
    ------
    StoreError
        A file is missing or is not what its name says; the message names the command that makes it.
    LogError
        A column is missing, or truth and estimates do not hold the same runs.
    """
    if not folder.is_dir():
        raise StoreError(
            f"{folder}: no such campaign folder; `airtruth fly CAMPAIGN.toml --out {folder}` makes it"
        )
    fly = f"`airtruth fly CAMPAIGN.toml --out {folder}`"
    identify = f"`airtruth identify {folder} --aircraft AIRCRAFT`"
    truth_path, estimates_path = folder / TRUTH, folder / ESTIMATES
    truth_table = _read(truth_path, ("run_id", "status", *ESTIMATED), fly)
    bounds = [name + end for name in ESTIMATED for end in ("_lower", "_upper")]
    needed = ("run_id", "method", "converged", "iterations", *ESTIMATED, *bounds)
    estimates_table = _read(estimates_path, needed, identify, optional=("status",))

    run_ids, flown, truth = _truth(truth_table, truth_path)
    methods = _strings(estimates_table, "method")
    rows = _strings(estimates_table, "run_id")
    matched = _match(run_ids, flown, rows, methods, estimates_path, identify)
    described = _describe(folder)
    if described.get("runs", len(run_ids)) != len(run_ids):
        raise LogError(
            f"{truth_path}: holds {len(run_ids)} of the {described['runs']} runs that {DESCRIPTION} plans; "
            f"{fly} flies the rest"
        )
    name = str(described.get("name", folder.resolve().name))
    if Path(name).name != name:
        raise StoreError(
            f"{folder / DESCRIPTION}: name {name!r} cannot be part of a file's name; leave out '/'"
        )
    gust = described.get("gust")
    return Campaign(
        folder=folder,
        name=name,
        title=str(described.get("title", name)),
        gust=gust if isinstance(gust, dict) else {},
        run_ids=run_ids,
        flown=flown,
        truth=truth,
        estimates={m: _method(estimates_table, at, of, len(run_ids)) for m, (at, of) in matched.items()},
    )


def _read(path: Path, needed: Iterable[str], maker: str, optional: Iterable[str] = ()) -> pa.Table:
    if not path.is_file():
        raise StoreError(f"{path}: missing; {maker} writes it")
    try:
        columns = pq.read_schema(path).names
        missing = [name for name in needed if name not in columns]
        if not missing:
            wanted = [*needed, *(name for name in optional if name in columns)]
            return pq.read_table(path, columns=wanted, page_checksum_verification=True)
    except (pa.ArrowException, OSError) as error:
        raise StoreError(f"{path}: not a readable Parquet file ({error}); {maker} writes it anew") from error
    told = "; ".join(_missing(name, columns) for name in missing)
    raise LogError(f"{path}: {told}; {maker} writes all that tables need")


def _missing(name: str, columns: list[str]) -> str:
    near = difflib.get_close_matches(name, columns, n=1, cutoff=0.8)
    return f"column {name!r} is missing" + (f" (there is {near[0]!r})" if near else "")


def _truth(table: pa.Table, path: Path) -> tuple[tuple[str, ...], NDArray[np.bool_], Array]:
    run_ids = tuple(_strings(table, "run_id"))
    if not run_ids:
        raise LogError(f"{path}: holds no run")
    twice = {run for run in run_ids if run_ids.count(run) > 1} if len(set(run_ids)) < len(run_ids) else set()
    if twice:
        raise LogError(f"{path}: {_some(twice)} listed more than once; run_id names one run")
    status = _strings(table, "status")
    for run, word in zip(run_ids, status, strict=True):
        if word not in (FLOWN, FAILED):
            raise LogError(f"{path}: status {word!r} of run {run!r}; {choices(word, (FLOWN, FAILED))}")
    flown = np.array([word == FLOWN for word in status])
    truth = np.where(flown[:, None], _numbers(table, ESTIMATED), np.nan)
    bad = flown & ~np.isfinite(truth).all(axis=1)
    if bad.any():
        raise LogError(f"{path}: {_some(np.array(run_ids)[bad])} flew, yet the truth is not a finite number")
    if not flown.any():
        raise LogError(f"{path}: none of the {len(run_ids)} runs flew; manifest.jsonl tells why")
    return run_ids, flown, truth


def _match(
    run_ids: tuple[str, ...],
    flown: NDArray[np.bool_],
    rows: list[str],
    methods: list[str],
    path: Path,
    maker: str,
) -> dict[str, tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Method -> rows of the estimates and the runs that they belong to, each flown run once."""
    index = {run: i for i, run in enumerate(run_ids)}
    strange = {run for run in rows if run not in index}
    if strange:
        raise LogError(
            f"{path}: {_some(strange)} not in {TRUTH}; tables need one estimate per run of this campaign "
            f"(no --joint, no foreign log): {maker}"
        )
    at = np.array([index[run] for run in rows], dtype=np.int64)
    of_method = np.array(methods, dtype=object)
    matched = {}
    for method in dict.fromkeys(methods):
        own = np.flatnonzero(of_method == method)
        times = np.bincount(at[own], minlength=len(run_ids))
        for wrong, told in (
            (times > 1, "has more than one estimate"),
            ((times > 0) & ~flown, f"did not fly (status in {TRUTH}) but has an estimate"),
            ((times == 0) & flown, f"flew (status in {TRUTH}) but has no estimate"),
        ):
            if wrong.any():
                runs = _some(np.array(run_ids)[wrong])
                raise LogError(
                    f"{path}: method {method!r}: {runs} {told}; identify the whole campaign: {maker}"
                )
        matched[method] = (own, at[own])
    if not matched:
        raise LogError(f"{path}: holds no estimate; {maker} writes it")
    return matched


def _method(table: pa.Table, rows: NDArray[np.int64], runs: NDArray[np.int64], total: int) -> MethodEstimates:
    own = table.take(rows)

    def spread(values: Array) -> Array:
        out = np.full((total, *values.shape[1:]), np.nan)
        out[runs] = values
        return out

    converged = np.zeros(total, dtype=np.bool_)
    converged[runs] = [bool(word) for word in own.column("converged").to_pylist()]
    status = np.full(total, "", dtype=object)
    status[runs] = _strings(own, "status") if "status" in own.column_names else "not converged"
    return MethodEstimates(
        values=spread(_numbers(own, ESTIMATED)),
        lower=spread(_numbers(own, [f"{name}_lower" for name in ESTIMATED])),
        upper=spread(_numbers(own, [f"{name}_upper" for name in ESTIMATED])),
        converged=converged,
        iterations=spread(_numbers(own, ["iterations"])[:, 0]),
        status=tuple(status),
    )


def _describe(folder: Path) -> Mapping[str, object]:
    path = folder / DESCRIPTION
    if not path.is_file():
        return {}
    try:
        described: Any = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(
            f"{path}: not readable JSON ({error}); mend it, or remove it to use the folder's name"
        ) from error
    if not isinstance(described, dict):
        raise StoreError(f'{path}: holds no JSON object; expected {{"name": ..., "title": ..., ...}}')
    return described


def _strings(table: pa.Table, name: str) -> list[str]:
    return ["" if value is None else str(value) for value in table.column(name).to_pylist()]


def _numbers(table: pa.Table, names: Iterable[str]) -> Array:
    columns = [table.column(name).to_numpy().astype(np.float64) for name in names]
    return np.stack(columns, axis=1)


def _some(runs: Iterable[object]) -> str:
    names = sorted(map(str, runs))
    shown = ", ".join(repr(name) for name in names[:3])
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"run{'s' if len(names) > 1 else ''} {shown}{more}"
