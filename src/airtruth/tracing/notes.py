"""Notes of an answer: what a reader has to know of the logs, the search and the report besides the effects."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from airtruth.quantity import Quantity
from airtruth.table import significant
from airtruth.tracing.answer import DeclaredModel
from airtruth.tracing.model.parameters import COLOUR_TIME_S, Parameters
from airtruth.tracing.replay import disagreement, worsened
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.tracing.stage_errors import Errors, PerChannel, Replay
from airtruth.tracing.stages import Stages, in_closed_loop

_WORTH_A_NOTE: Final = 0.02
"""Share of correlated noise in a sensor's variance from which a note mentions it [-] (judgement: a smaller share
is of no use to a reader)."""
_FAR: Final = 5.0
"""Distance of an estimate from a declared derivative from which a note states it, in standard deviations of the estimate [-]
(judgement: no chance over six derivatives)."""
_WORSE: Final = 1.02
"""Error of held-out records after over that before, from which a note states it [-] (judgement)."""
_TIMES: Final = 2.0
"""Ratio of two errors from which the ratio is stated and not the difference [-] (convention)."""
_IN_LOOP: Final = (
    "{controls} to the motion (a damper, an autopilot or a pilot): gusts move {them} too, so that the free run of a "
    "false model may come closer than that of the true one; the innovations remain a valid test"
)
"""Note of a trace in closed loop."""


def notes(
    stages: Stages,
    last: SearchRound,
    declared: DeclaredModel,
    errors: Errors,
    replay: Replay | None,
    forced: Sequence[str],
) -> Iterator[str]:
    """Each note, in words.

    Parameters
    ----------
    stages, last : assessed stages, and the last round of the search.
    declared : test of the declared model.
    errors : of every stage.
    replay : records flown again in JSBSim, None where nothing was flown again.
    forced : faults of the logs that the caller overruled.
    """
    yield from stages.case.notes
    yield from _correlated_noise(last.null.point)
    if declared.consistent:
        yield from within_assumed_uncertainty(
            declared, stages.case.fitted.records[0].plant.aircraft.file.derivatives
        )
    yield from worse_held_out(errors)
    if in_closed_loop(stages):
        names = [c.name for c in stages.case.fitted.layout.motion.controls]
        several = len(names) > 1
        yield _IN_LOOP.format(
            controls=f"the {' or the '.join(names)} responds", them="them" if several else "it"
        )
    if stages.case.left_out:
        yield (
            "the time budget ended the search, so the answer is provisional; left out: "
            + "; ".join(stages.case.left_out)
        )
    if replay is not None:
        yield from disagreement(replay, stages)
        yield from worsened(replay)
    if forced:
        yield "the logs contradict physics and were traced because of --force: " + "; ".join(forced)


def worse_held_out(errors: Errors) -> Iterator[str]:
    """An error of the held-out records that is larger after than before, however uncertain the difference is."""
    before, after = (errors.stages.get(stage) for stage in ("before", "after"))
    if before is None or after is None or before.held_out is None or after.held_out is None:
        return
    for words, old, new in (
        ("the free run", before.held_out.free_run, after.held_out.free_run),
        ("the innovations", before.held_out.innovation, after.held_out.innovation),
    ):
        was, own = (_relative(error, errors.channels) for error in (old, new))
        if was > 0.0 and own > _WORSE * was:
            ratio = own / was
            larger = (
                f"{100.0 * (ratio - 1.0):.0f} % larger after than before"
                if ratio < _TIMES
                else f"{significant(ratio)} times as large after as before"
            )
            yield (
                f"on the held-out records, the error of {words} is {larger}; `confirmed` states whether the difference is "
                "significant"
            )


def _relative(error: PerChannel, signal: PerChannel) -> float:
    """Root mean square over the channels of error over signal [-]."""
    return float(np.sqrt(np.mean([(e / signal[channel]) ** 2 for channel, e in error.items()])))


def within_assumed_uncertainty(declared: DeclaredModel, stated: Mapping[str, Quantity]) -> Iterator[str]:
    """Derivatives that the records determine elsewhere, within an uncertainty that the aircraft does not state."""
    far = [
        f"{name} {significant(s.estimate)} +- {significant(s.std, 2)} for {significant(s.declared)} +- "
        f"{significant(s.declared_std, 2)}"
        for name, s in declared.shifts.items()
        if abs(s.estimate - s.declared) > _FAR * s.std and not (name in stated and stated[name].std > 0.0)
    ]
    if far:
        yield (
            f"within an uncertainty that airtruth assumes, because aircraft.toml states none, the records give {', '.join(far)}; "
            "state the std of [derivatives] there for a stricter test"
        )


def _correlated_noise(point: Parameters) -> Iterator[str]:
    common, entries = point.common, point.of.common
    channels = point.of.motion.output_channels
    shares = {
        channel: float(share) for channel, share in zip(channels, common[entries.colour_shares], strict=True)
    }
    named = [
        f"{100.0 * share:.0f} % of {channel}" for channel, share in shares.items() if share > _WORTH_A_NOTE
    ]
    if named:
        time_s = COLOUR_TIME_S * math.exp(common[entries.log_colour_time])
        yield (
            f"the sensor noise is correlated in time: {', '.join(named)} of the noise variance, over {time_s:.2g} s"
        )


__all__ = ["notes", "within_assumed_uncertainty"]
