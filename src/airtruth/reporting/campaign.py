"""A campaign as tables need it: the truth of each run and the estimates of each method.

The truth serves tables and scoring alone; identification and tracing never read it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Final, Protocol

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from airtruth.errors import LogError, StoreError, choices
from airtruth.logs.names import ESTIMATES as FILES
from airtruth.physics.motion import LONGITUDINAL, MOTIONS, Motion
from airtruth.reporting.columns import Kind, flags, numbers, read_columns, texts
from airtruth.reporting.description import DESCRIPTION, describe
from airtruth.reporting.partial import Sample

Array = NDArray[np.float64]

TRUTH: Final = "truth.parquet"
"""File of the true parameters of each run."""

FLOWN: Final = "ok"
"""Status of a run that has a log."""

FAILED: Final = "failed"
"""Status of a run that could not be flown."""


def truth_kinds(motion: Motion) -> dict[str, Kind]:
    """Columns of the truth of a motion that tables need."""
    return {"run_id": "text", "status": "text", **dict.fromkeys(motion.estimated, "number")}


def estimate_kinds(motion: Motion) -> dict[str, Kind]:
    """Columns of the estimates of a motion that reports need; the status may be absent."""
    names = motion.estimated
    bounds = (name + end for name in names for end in ("_lower", "_upper"))
    return {
        "run_id": "text",
        "method": "text",
        "status": "text",
        "converged": "flag",
        "iterations": "number",
        **dict.fromkeys((*names, *bounds), "number"),
    }


@dataclass(frozen=True)
class MethodEstimates:
    """Estimates of one method; rows follow `Campaign.run_ids`, NaN where a run did not fly.

    Attributes
    ----------
    values, lower, upper : (runs, estimated) as `Motion.estimated`, and the bounds of their intervals.
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
class FlownCampaign:
    """A flown and identified campaign, of one motion.

    Attributes
    ----------
    folder : folder of the campaign.
    name, title : short name and heading.
    gust : gust settings in words, empty if campaign.json does not state them.
    run_ids : planned runs.
    flown : (runs,) whether the run has a log.
    truth : (runs, estimated) truth of each run, NaN where it did not fly.
    estimates : method -> estimates.
    motion : whose parameters they are.
    """

    folder: Path
    name: str
    title: str
    gust: str
    run_ids: tuple[str, ...]
    flown: NDArray[np.bool_]
    truth: Array
    estimates: Mapping[str, MethodEstimates]
    motion: Motion = LONGITUDINAL

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods with estimates."""
        return tuple(self.estimates)

    @property
    def runs(self) -> int:
        """Number of planned runs."""
        return len(self.run_ids)

    def parts(self) -> Iterator[FlownCampaign]:
        """Yield the campaign as its only part."""
        yield self

    def sample(self, method: str) -> Sample:
        """Truth and estimates of one method."""
        e = self.estimates[method]
        return Sample(
            self.truth,
            self.flown,
            e.values,
            e.lower,
            e.upper,
            e.converged,
            e.iterations,
            e.status,
            self.motion,
        )


class Parted(Protocol):
    """A campaign whose runs come in parts: a `FlownCampaign` in memory, or one that is read part by part.

    Attributes
    ----------
    folder, name, title, gust : as in `FlownCampaign`.
    methods : methods with estimates.
    runs : number of planned runs.
    motion : whose parameters are estimated.
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
    @property
    def motion(self) -> Motion: ...
    def parts(self) -> Iterable[FlownCampaign]:
        """Return the same parts at each call, each run in one of them, in the order of the truth."""
        ...


def average_truth(campaign: Parted) -> Array:
    """Return the mean truth of the runs that flew, (estimated,); exact if all of them share one truth."""
    names = campaign.motion.estimated
    first, total, count = None, np.zeros(len(names)), 0
    with np.errstate(over="ignore", invalid="ignore"):
        for part in campaign.parts():
            truth = part.truth[part.flown]
            if len(truth):
                first = truth[0] if first is None else first
                total += (truth - first).sum(axis=0)
                count += len(truth)
        return np.full(len(names), np.nan) if first is None else np.asarray(first + total / count)


def motions_of(folder: Path) -> tuple[Motion, ...]:
    """Motions of which a folder holds estimates; the longitudinal one if it holds none."""
    found = tuple(motion for motion in MOTIONS.values() if (folder / FILES[motion.name]).is_file())
    return found or (LONGITUDINAL,)


def read_campaign(folder: Path, motion: Motion = LONGITUDINAL) -> FlownCampaign:
    """Read the truth and the estimates of a motion from a campaign folder.

    Raises
    ------
    StoreError
        A file is missing or unreadable, or campaign.json is malformed; the message names the command that writes it.
    LogError
        A column is missing or has the wrong type, or truth and estimates do not hold the same runs.
    """
    fly, identify = writers(folder, motion)
    if not folder.is_dir():
        raise StoreError(f"{folder}: no such campaign folder; {fly} creates it")
    truth_path, estimates_path = folder / TRUTH, folder / FILES[motion.name]
    run_ids, flown, truth = _truth(read_columns(truth_path, truth_kinds(motion), fly), truth_path, motion)
    estimates = read_estimates(estimates_path, identify, motion)
    rows_of = _match(run_ids, flown, estimates, estimates_path, identify)
    described = describe(folder)
    if described.runs is not None and described.runs != len(run_ids):
        raise LogError(
            f"{truth_path}: holds {len(run_ids)} of the {described.runs} runs that {DESCRIPTION} plans; "
            f"{fly} flies the others"
        )
    return FlownCampaign(
        folder=folder,
        name=described.name,
        title=described.title,
        gust=described.gust,
        run_ids=run_ids,
        flown=flown,
        truth=truth,
        estimates={
            m: estimates_of(estimates, rows, runs, len(run_ids), motion)
            for m, (rows, runs) in rows_of.items()
        },
        motion=motion,
    )


def writers(folder: Path, motion: Motion) -> tuple[str, str]:
    """The commands that write the truth and the estimates of a motion in a folder, for messages."""
    shown = quote(str(folder))
    # without the option a command answers each motion that the records excite
    others = any((folder / FILES[m.name]).exists() for m in MOTIONS.values() if m is not LONGITUDINAL)
    named = f" --motion {motion.name}" if others else ""
    return (
        f"`airtruth fly CAMPAIGN.toml --out {shown}`",
        f"`airtruth identify {shown} --aircraft AIRCRAFT{named}`",
    )


def read_estimates(path: Path, writer: str, motion: Motion) -> pa.Table:
    """Read the columns `estimate_kinds` of a file of estimates.

    Parameters
    ----------
    path : the file.
    writer : command that writes it, for messages.
    motion : whose parameters it holds.

    Raises
    ------
    StoreError, LogError
        See `read_columns`; or the file holds no estimate.
    """
    table = read_columns(path, estimate_kinds(motion), writer, optional=("status",))
    if not table.num_rows:
        raise LogError(f"{path}: holds no estimate; {writer} writes it")
    return table


def _truth(table: pa.Table, path: Path, motion: Motion) -> tuple[tuple[str, ...], NDArray[np.bool_], Array]:
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
    truth = np.where(flown[:, None], numbers(table, motion.estimated), np.nan)
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
    table: pa.Table, rows: NDArray[np.int64], runs: NDArray[np.int64], total: int, motion: Motion
) -> MethodEstimates:
    """Estimates of one method.

    Parameters
    ----------
    table : columns `estimate_kinds`.
    rows : its rows of the method.
    runs : index of the run of each of these rows.
    total : number of runs.
    motion : whose parameters are read.
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
        values=per_run(numbers(own, motion.estimated)),
        lower=per_run(numbers(own, [f"{name}_lower" for name in motion.estimated])),
        upper=per_run(numbers(own, [f"{name}_upper" for name in motion.estimated])),
        converged=converged,
        iterations=per_run(numbers(own, ["iterations"])[:, 0]),
        status=tuple(status),
    )


def _some(runs: Iterable[object]) -> str:
    names = sorted(map(str, runs))
    shown = ", ".join(repr(name) for name in names[:3])
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"run{'s' if len(names) > 1 else ''} {shown}{more}"
