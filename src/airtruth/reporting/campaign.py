"""A campaign as tables need it: the truth of each run and the estimates of each method.

The truth serves tables and scoring alone; identification and tracing never read it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Final, Protocol

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from airtruth.documents import read_json
from airtruth.errors import LogError, StoreError, choices
from airtruth.logs.names import ESTIMATES as FILES
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.reporting.columns import Kind, flags, numbers, read_columns, texts
from airtruth.reporting.paper.published import ESTIMATED
from airtruth.reporting.partial import Sample

Array = NDArray[np.float64]

TRUTH: Final = "truth.parquet"
"""File of the true parameters of each run."""

ESTIMATES: Final = FILES[LONGITUDINAL.name]
"""File of the estimates (contract 2)."""

DESCRIPTION: Final = "campaign.json"
"""File of the campaign's name, title, number of runs and gust settings."""

FLOWN: Final = "ok"
"""Status of a run that has a log."""

FAILED: Final = "failed"
"""Status of a run that could not be flown."""

TRUTH_KINDS: Final[Mapping[str, Kind]] = {
    "run_id": "text",
    "status": "text",
    **dict.fromkeys(ESTIMATED, "number"),
}
"""Columns of the truth that tables need."""


def estimate_kinds(names: Sequence[str]) -> dict[str, Kind]:
    """Columns of the estimates of parameters that reports need; the status may be absent."""
    bounds = (name + end for name in names for end in ("_lower", "_upper"))
    return {
        "run_id": "text",
        "method": "text",
        "status": "text",
        "converged": "flag",
        "iterations": "number",
        **dict.fromkeys((*names, *bounds), "number"),
    }


ESTIMATE_KINDS: Final[Mapping[str, Kind]] = estimate_kinds(ESTIMATED)
"""Columns of the longitudinal estimates."""


@dataclass(frozen=True)
class MethodEstimates:
    """Estimates of one method; rows follow `Campaign.run_ids`, NaN where a run did not fly.

    Attributes
    ----------
    values, lower, upper : (runs, 8) six derivatives [-], wn [rad/s], zeta [-], and the bounds of their intervals.
    converged : (runs,) whether the method converged.
    iterations : (runs,) number of iterations.
    status : (runs,) how the estimation of each run ended.
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
    folder : folder of the campaign.
    name, title : short name and heading.
    gust : gust settings in words, empty if campaign.json does not state them.
    run_ids : planned runs.
    flown : (runs,) whether the run has a log.
    truth : (runs, 8) truth of each run, NaN where it did not fly.
    estimates : method -> estimates.
    """

    folder: Path
    name: str
    title: str
    gust: str
    run_ids: tuple[str, ...]
    flown: NDArray[np.bool_]
    truth: Array
    estimates: Mapping[str, MethodEstimates]

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods with estimates."""
        return tuple(self.estimates)

    @property
    def runs(self) -> int:
        """Number of planned runs."""
        return len(self.run_ids)

    def parts(self) -> Iterator[Campaign]:
        """Yield the campaign as its only part."""
        yield self

    def sample(self, method: str) -> Sample:
        """Truth and estimates of one method."""
        e = self.estimates[method]
        return Sample(self.truth, self.flown, e.values, e.lower, e.upper, e.converged, e.iterations, e.status)


class Parted(Protocol):
    """A campaign whose runs come in parts: a `Campaign` in memory, or one that is read part by part.

    Attributes
    ----------
    folder, name, title, gust : as in `Campaign`.
    methods : methods with estimates.
    runs : number of planned runs.
    """

    @property
    def folder(self) -> Path: ...
    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def gust(self) -> str: ...
    @property
    def methods(self) -> tuple[str, ...]: ...
    @property
    def runs(self) -> int: ...
    def parts(self) -> Iterable[Campaign]:
        """Return the same parts at each call, each run in one of them, in the order of the truth."""
        ...


def average_truth(campaign: Parted) -> Array:
    """Return the mean truth of the runs that flew, (8,); exact if all of them share one truth."""
    first, total, count = None, np.zeros(len(ESTIMATED)), 0
    with np.errstate(over="ignore", invalid="ignore"):
        for part in campaign.parts():
            truth = part.truth[part.flown]
            if len(truth):
                first = truth[0] if first is None else first
                total += (truth - first).sum(axis=0)
                count += len(truth)
        return np.full(len(ESTIMATED), np.nan) if first is None else np.asarray(first + total / count)


@dataclass(frozen=True)
class Description:
    """The entries of campaign.json that tables show; ``runs`` is None where the file does not state it."""

    name: str
    title: str
    runs: int | None
    gust: str


def read_campaign(folder: Path) -> Campaign:
    """Read the truth and the estimates of a campaign folder.

    Raises
    ------
    StoreError
        A file is missing or unreadable, or campaign.json is malformed; the message names the command that writes it.
    LogError
        A column is missing or has the wrong type, or truth and estimates do not hold the same runs.
    """
    fly, identify = writers(folder)
    if not folder.is_dir():
        raise StoreError(f"{folder}: no such campaign folder; {fly} creates it")
    truth_path, estimates_path = folder / TRUTH, folder / ESTIMATES
    run_ids, flown, truth = _truth(read_columns(truth_path, TRUTH_KINDS, fly), truth_path)
    estimates = read_estimates(estimates_path, identify)
    rows_of = _match(run_ids, flown, estimates, estimates_path, identify)
    described = describe(folder)
    if described.runs is not None and described.runs != len(run_ids):
        raise LogError(
            f"{truth_path}: holds {len(run_ids)} of the {described.runs} runs that {DESCRIPTION} plans; "
            f"{fly} flies the others"
        )
    return Campaign(
        folder=folder,
        name=described.name,
        title=described.title,
        gust=described.gust,
        run_ids=run_ids,
        flown=flown,
        truth=truth,
        estimates={
            m: estimates_of(estimates, rows, runs, len(run_ids)) for m, (rows, runs) in rows_of.items()
        },
    )


def writers(folder: Path) -> tuple[str, str]:
    """The commands that write the truth and the estimates of a folder, for messages."""
    shown = quote(str(folder))
    # a campaign of lateral records has estimates of the lateral motion alone, which tables and reports do not show
    motion = f" --motion {LONGITUDINAL.name}" if (folder / FILES[LATERAL.name]).exists() else ""
    return (
        f"`airtruth fly CAMPAIGN.toml --out {shown}`",
        f"`airtruth identify {shown} --aircraft AIRCRAFT{motion}`",
    )


def read_estimates(path: Path, writer: str, names: Sequence[str] = ESTIMATED) -> pa.Table:
    """Read the columns `estimate_kinds` of a file of estimates.

    Parameters
    ----------
    path : the file.
    writer : command that writes it, for messages.
    names : its parameters.

    Raises
    ------
    StoreError, LogError
        See `read_columns`; or the file holds no estimate.
    """
    table = read_columns(path, estimate_kinds(names), writer, optional=("status",))
    if not table.num_rows:
        raise LogError(f"{path}: holds no estimate; {writer} writes it")
    return table


def _truth(table: pa.Table, path: Path) -> tuple[tuple[str, ...], NDArray[np.bool_], Array]:
    run_ids = tuple(texts(table, "run_id"))
    if not run_ids:
        raise LogError(f"{path}: holds no run")
    twice = [run for run, count in Counter(run_ids).items() if count > 1]
    if twice:
        raise LogError(f"{path}: {_some(twice)} listed more than once; run_id names one run")
    status = texts(table, "status")
    for run, word in zip(run_ids, status, strict=True):
        if word not in (FLOWN, FAILED):
            raise LogError(f"{path}: status {word!r} of run {run!r}; {choices(word, (FLOWN, FAILED))}")
    flown = np.array([word == FLOWN for word in status])
    truth = np.where(flown[:, None], numbers(table, ESTIMATED), np.nan)
    bad = flown & ~np.isfinite(truth).all(axis=1)
    if bad.any():
        raise LogError(f"{path}: {_some(np.array(run_ids)[bad])} flew, but the truth is not a finite number")
    if not flown.any():
        raise LogError(f"{path}: none of the {len(run_ids)} runs flew; manifest.jsonl states the reasons")
    return run_ids, flown, truth


def _match(
    run_ids: tuple[str, ...], flown: NDArray[np.bool_], estimates: pa.Table, path: Path, writer: str
) -> dict[str, tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Method -> rows of the estimates, and the indices of their runs; each flown run once."""
    rows, methods = texts(estimates, "run_id"), texts(estimates, "method")
    index = {run: i for i, run in enumerate(run_ids)}
    foreign = {run for run in rows if run not in index}
    if foreign:
        raise LogError(
            f"{path}: {_some(foreign)} not in {TRUTH}; tables need one estimate per run of this campaign "
            f"(no --joint, no foreign log): {writer}"
        )
    run_of_row = np.array([index[run] for run in rows], dtype=np.int64)
    method_of_row = np.array(methods, dtype=object)
    matched = {}
    for method in dict.fromkeys(methods):
        own = np.flatnonzero(method_of_row == method)
        times = np.bincount(run_of_row[own], minlength=len(run_ids))
        for wrong, fault in (
            (times > 1, "has more than one estimate"),
            ((times > 0) & ~flown, f"did not fly (status in {TRUTH}) but has an estimate"),
            ((times == 0) & flown, f"flew (status in {TRUTH}) but has no estimate"),
        ):
            if wrong.any():
                runs = _some(np.array(run_ids)[wrong])
                raise LogError(
                    f"{path}: method {method!r}: {runs} {fault}; identify the whole campaign: {writer}"
                )
        matched[method] = (own, run_of_row[own])
    return matched


def estimates_of(
    table: pa.Table, rows: NDArray[np.int64], runs: NDArray[np.int64], total: int
) -> MethodEstimates:
    """Estimates of one method.

    Parameters
    ----------
    table : columns `ESTIMATE_KINDS`.
    rows : its rows of the method.
    runs : index of the run of each of these rows.
    total : number of runs.
    """
    own = table.take(rows)

    def per_run(values: Array) -> Array:
        out = np.full((total, *values.shape[1:]), np.nan)
        out[runs] = values
        return out

    converged = np.zeros(total, dtype=np.bool_)
    converged[runs] = flags(own, "converged")
    status = np.full(total, "", dtype=object)
    status[runs] = texts(own, "status") if "status" in own.column_names else "not converged"
    return MethodEstimates(
        values=per_run(numbers(own, ESTIMATED)),
        lower=per_run(numbers(own, [f"{name}_lower" for name in ESTIMATED])),
        upper=per_run(numbers(own, [f"{name}_upper" for name in ESTIMATED])),
        converged=converged,
        iterations=per_run(numbers(own, ["iterations"])[:, 0]),
        status=tuple(status),
    )


def describe(folder: Path) -> Description:
    """Read campaign.json of a folder; without it the folder's name serves.

    Raises
    ------
    StoreError
        If the file is malformed.
    """
    path = folder / DESCRIPTION
    fallback = folder.resolve().name
    if not path.is_file():
        return Description(fallback, fallback, None, "")
    cure = "correct it, or remove it to use the folder's name"
    entries = read_json(path, StoreError, cure)
    if not isinstance(entries, dict):
        raise StoreError(f'{path}: holds no JSON object; expected {{"name": ..., "title": ..., ...}}')
    gust = entries.get("gust")
    words = (
        ", ".join(f"{key} {_words(value)}" for key, value in gust.items()) if isinstance(gust, dict) else ""
    )
    name = entries.get("name", fallback)
    title, runs = entries.get("title", name), entries.get("runs")
    if not (isinstance(name, str) and isinstance(title, str)):
        raise StoreError(f"{path}: name and title must be text; {cure}")
    if Path(name).name != name or not name.isprintable():
        raise StoreError(f"{path}: name {name!r} cannot be part of a file's name; leave out '/'")
    if not (runs is None or isinstance(runs, int)):
        raise StoreError(f"{path}: runs {runs!r} must be a whole number; {cure}")
    return Description(name, title or name, runs, words)


def _words(setting: object) -> str:
    """A gust setting in words: a plain value, or a distribution with its parameters."""
    if not isinstance(setting, dict):
        return str(setting)
    if set(setting) == {"value"}:
        return str(setting["value"])
    return " ".join(f"{key} {_words(value)}" for key, value in setting.items() if value is not None)


def _some(runs: Iterable[object]) -> str:
    names = sorted(map(str, runs))
    shown = ", ".join(repr(name) for name in names[:3])
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"run{'s' if len(names) > 1 else ''} {shown}{more}"
