"""Scores as Markdown, JSON and figures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from validation.blind.figures import STRONG
from validation.blind.scoring import CLASSES, HOLM, LEVEL, Case, Share, bound, detection

_PANELS: Final = 12


def _range(low: float, high: float) -> str:
    return f"above {low:g}" if np.isinf(high) else f"{low:g} to {high:g}"


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def _number(value: float | None, digits: int = 2) -> str:
    return "-" if value is None or np.isnan(value) else f"{value:.{digits}f}"


def _averaged(pair: tuple[float, int]) -> str:
    return f"{_number(pair[0])} (of {pair[1]})"


def markdown(
    scores: Mapping[str, Any],
    sets: Mapping[str, Mapping[str, Any]] | None = None,
    bands: tuple[float, int] | None = None,
) -> str:
    """All scores; shares with their 95 % Clopper-Pearson intervals.

    Parameters
    ----------
    scores : of `scoring.score`.
    sets : of `set_scoring.set_scores`.
    bands : of `bands.score`.
    """
    parts = [_of_sets(mode, one) for mode, one in (sets or {}).items()]
    of_sets = sum(one["trials"] for one in (sets or {}).values())
    if not of_sets or scores["trials"] - len(scores["failed"]) > of_sets:
        parts.append(_of_single_effects(scores))
    if bands is not None and bands[1]:
        share = f"{bands[0]:.2f} of the samples, mean of {bands[1]} tables"
        parts.append(f"The 95 % band of a learned table contains the true curve about {share}.")
    return "\n\n".join(parts) + "\n"


def _of_sets(mode: str, scores: Mapping[str, Any]) -> str:
    """Scores of one of `causes.COMPOSITIONS` or `figures.CONDITIONS`."""
    summary: list[tuple[str, object]] = [
        (f"mode {mode}: trials; above lambda {STRONG:g}", f"{scores['trials']}; {scores['strong']}"),
        ("declared model called contradicted", scores["contradicted"]),
        (
            "the same, expected of a chi-square test with six degrees of freedom",
            _averaged(scores["contradiction_power"]),
        ),
        (
            "the same, of aircraft that fly outside their declared uncertainty",
            scores["contradicted_outside"],
        ),
        ("right set first", scores["first"]),
        ("right set first, bound by the nearest set", _averaged(scores["first_bound"])),
        ("right set among the reported", scores["reported"]),
        ("derivatives inside their 95 % interval", scores["derivative_coverage"]),
        ("the same where the right set is first", scores["derivative_coverage_right"]),
        ("parameters inside their 95 % interval", scores["parameter_coverage"]),
        ("held-out error after / truth's own, median", _averaged(scores["after_over_oracle"])),
        ("held-out error worse, and the answer does not state it", scores["worse_unstated"]),
    ]
    if "false_trace" in scores:
        summary += [
            ("wrong effect named without reservation", scores["wrong_without_reservation"]),
            ("false traces on trials without an effect", scores["false_trace"]),
            ("trials without an effect called unexplained", scores["null_anomaly"]),
        ]
    rows = [
        (
            row["truth"],
            row["contradicted"],
            row["first"],
            row["reported"],
            "; ".join(f"{name} {n}" for name, n in row["otherwise"].items()),
        )
        for row in scores["by_set"]
    ]
    head = ("truth", "contradicted", "first", "reported", "otherwise")
    return _table(("", "share (95 % interval)"), summary) + "\n\n" + _table(head, rows)


def _of_single_effects(scores: Mapping[str, Any]) -> str:
    strong, pairs, clutter = (scores[k] for k in ("strong", "pairs", "clutter"))
    summary: list[tuple[str, object]] = [
        ("trials; tracer failed", f"{scores['trials']}; {len(scores['failed'])}"),
        *((f"false traces on nulls, {air}", s) for air, s in scores["false_trace"].items()),
        ("false traces on nulls", scores["false_trace_all"]),
        ("nulls called unexplained", scores["null_anomaly"]),
        ("nulls with a learned increment", scores["null_increment"]),
        *(
            (f"declared model falsely contradicted, {air}", s)
            for air, s in scores["false_contradiction"].items()
        ),
        *(
            (f"the same, of aircraft that fly within their declared uncertainty, {air}", s)
            for air, s in scores["false_contradiction_inside"].items()
        ),
        (f"single effects above lambda {STRONG:g}: something named", strong["detected"]),
        ("name in the reported set", strong["in_set"]),
        ("name first", strong["first"]),
        ("name first, bound by the nearest rival", _averaged(strong["first_bound"])),
        ("given that something is named: in the set", strong["in_set_of_detected"]),
        ("given that something is named: first", strong["first_of_detected"]),
        ("mean size of the set", _number(strong["mean_set_size"])),
        ("above lambda 150: in the set", scores["very_strong_in_set"]),
        ("parameters inside their 95 % interval", strong["coverage"]),
        ("spurious second effect", strong["second_effect"]),
        ("held-out error after / truth's own, median", _averaged(scores["after_over_oracle"])),
        ("held-out error before / truth's own, median", _averaged(scores["before_over_oracle"])),
        ("calm air: held-out error after / before, median", _averaged(scores["calm_after_over_before"])),
        *_of_lacking("off-library", scores["off_library"]),
        *_of_lacking("leave-one-out", scores["leave_one_out"]),
        ("pairs, both above: both in the sets", pairs["both_in_sets"]),
        ("pairs: one of them in the sets", pairs["one_in_sets"]),
        ("pairs: the first name is one of them", pairs["first_is_one"]),
        ("clutter: dominant effect first", clutter["dominant_first"]),
        ("clutter: dominant effect in the set", clutter["dominant_in_set"]),
        ("clutter alone: something named", clutter["named_without_dominant"]),
        ("clutter: held-out error not worse", clutter["held_out_not_worse"]),
    ]
    parts = [_table(("", "share (95 % interval)"), summary)]
    parts.append(f"Detection of single effects; score test at level {LEVEL:g}.")
    parts.append(
        _table(
            ("lambda", "bound", "score significant", "effect named", "something named"),
            [
                (_range(r["from"], r["to"]), _number(r["bound"]), r["score"], r["named"], r["something"])
                for r in scores["detection"]
            ],
        )
    )
    parts.append(
        _table(
            (
                "effect",
                f"bound at {LEVEL:g}",
                "score significant",
                f"bound at {HOLM:.2g}",
                "score significant",
                "named",
                f"named above lambda {STRONG:g}",
            ),
            [
                (
                    r["effect"],
                    _number(r["bound"]),
                    r["score"],
                    _number(r["bound_holm"]),
                    r["score_holm"],
                    r["named"],
                    r["strong"],
                )
                for r in scores["by_effect"]
            ],
        )
    )
    parts.append(f"Confusion: truth against the name given first; effects above lambda {STRONG:g}.")
    rows = []
    for truth, row in scores["confusion"].items():
        others = ", ".join(
            f"{name} {n}" for name, n in sorted(row.items(), key=lambda x: -x[1]) if name != truth
        )
        rows.append((truth, sum(row.values()), row.get(truth, 0), others))
    parts.append(_table(("truth", "trials", "so named", "otherwise"), rows))
    return "\n\n".join(parts)


def _of_lacking(mode: str, scores: Mapping[str, Any]) -> list[tuple[str, object]]:
    """Rows of `scoring.lacking`."""
    rows: list[tuple[str, object]] = [
        (f"{mode}: unexplained, learned or provisional", scores["flagged"]),
        (f"{mode}: an increment was learned", scores["learned"]),
    ]
    for words, key in (
        (", learned", ""),
        ("", "_of_all"),
        (", effects that increments express", "_of_curves"),
    ):
        for stage in ("after", "before"):
            error = _averaged(scores[f"{stage}_over_oracle{key}"])
            rows.append((f"{mode}{words}: held-out error {stage} over the truth's own", error))
    return [
        *rows,
        (f"{mode}: named without reservation", scores["named_without_reservation"]),
        (f"{mode}: passed as none", scores["passed_as_none"]),
        (f"{mode}: held-out error worse, and `confirmed` is not false", scores["worse_not_denied"]),
        (f"{mode}: held-out error worse, and the answer does not state it", scores["worse_unstated"]),
    ]


def as_json(scores: Mapping[str, Any]) -> str:
    """All scores with intervals as JSON."""

    def plain(value: Any) -> Any:
        if isinstance(value, Share):
            low, high = value.interval
            return {"hits": value.hits, "of": value.count, "low": low, "high": high}
        if isinstance(value, Mapping):
            return {k: plain(v) for k, v in value.items()}
        if isinstance(value, list | tuple):
            return [plain(v) for v in value]
        return None if isinstance(value, float) and not np.isfinite(value) else value

    return json.dumps(plain(scores), indent=1, allow_nan=False) + "\n"


def figures(scores: Mapping[str, Any], cases: Sequence[Case], out: Path) -> list[Path]:
    """Detection against its bound, the same per effect, and the confusion matrix, as PNG."""
    from airtruth import style

    paths = []
    with style.applied():
        figure = style.new_figure(6.0, 3.8)
        ax = figure.subplots()
        grid = np.geomspace(0.5, 1000.0, 200)
        ax.plot(grid, [bound(x) for x in grid], color=style.BLACK, label="noncentral chi-square bound")
        rows = detection(cases)
        for name, colour, shift in (("score", style.BLUE, 0.96), ("named", style.VERMILLION, 1.04)):
            some = [(r, r[name]) for r in rows if r[name].count]
            x = [shift * np.sqrt(max(r["from"], 1.0) * min(r["to"], 1000.0)) for r, _ in some]
            y = np.array([s.value for _, s in some])
            ends = np.array([s.interval for _, s in some]).reshape(-1, 2).T
            label = "score significant" if name == "score" else "effect accepted and in the set"
            ax.errorbar(x, y, np.abs(ends - y), fmt="o", color=colour, capsize=2, label=label)
        ax.set(xscale="log", xlabel="noncentrality", ylabel="share of trials", ylim=(-0.03, 1.03))
        style.legend_above(figure, [ax])
        paths.append(out / "detection.png")
        style.save(figure, paths[-1])
        paths += _per_effect(scores, out) + _matrix(scores, out)
    return paths


def _per_effect(scores: Mapping[str, Any], out: Path) -> list[Path]:
    from airtruth import style

    rows = sorted(scores["by_effect"], key=lambda r: -len(r["curve"]))[:_PANELS]
    if not rows:
        return []
    figure = style.new_figure(8.5, 2.0 * ((len(rows) + 3) // 4) + 0.6)
    axes = figure.subplots((len(rows) + 3) // 4, min(len(rows), 4), sharex=True, sharey=True, squeeze=False)
    grid = np.geomspace(0.5, 2000.0, 200)
    for ax, row in zip(axes.flat, rows, strict=False):
        ax.plot(grid, [bound(x) for x in grid], color=style.BLACK, label="bound")
        for name, colour, marker in (("score", style.BLUE, "o"), ("named", style.VERMILLION, "x")):
            x, y = _binned(row["curve"], name)
            ax.plot(x, y, marker, color=colour, ms=4, label="score" if name == "score" else "named")
        ax.set_title(row["effect"], fontsize=8)
        ax.set(xscale="log", ylim=(-0.05, 1.05))
    for ax in axes.flat[len(rows) :]:
        ax.set_visible(False)
    figure.supxlabel("noncentrality", fontsize=9)
    style.legend_above(figure, axes.flat[:1])
    path = out / "effects.png"
    style.save(figure, path)
    return [path]


def _binned(curve: Sequence[Mapping[str, Any]], name: str) -> tuple[list[float], list[float]]:
    x, y = [], []
    for low, high in CLASSES:
        some = [
            p for p in curve if low <= p["lambda"] < high and (name == "named" or p["p_value"] is not None)
        ]
        if some:
            x.append(float(np.exp(np.mean([np.log(max(p["lambda"], 0.5)) for p in some]))))
            y.append(float(np.mean([p["named"] if name == "named" else p["p_value"] < LEVEL for p in some])))
    return x, y


def _matrix(scores: Mapping[str, Any], out: Path) -> list[Path]:
    from airtruth import style

    table = scores["confusion"]
    if not table:
        return []
    given = sorted({name for row in table.values() for name in row})
    counts = np.array([[row.get(name, 0) for name in given] for row in table.values()], dtype=float)
    shares = counts / counts.sum(axis=1, keepdims=True)
    figure = style.new_figure(0.28 * len(given) + 3.0, 0.22 * len(table) + 2.4)
    ax = figure.subplots()
    ax.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for i, j in zip(*np.nonzero(counts), strict=True):
        colour = "white" if shares[i, j] > 0.6 else style.BLACK
        ax.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=6.5, color=colour)
    ax.grid(False)
    ax.set_xticks(range(len(given)), given, rotation=90, fontsize=7)
    ax.set_yticks(range(len(table)), list(table), fontsize=7)
    ax.set(xlabel="name given first", ylabel="truth")
    path = out / "confusion.png"
    style.save(figure, path)
    return [path]
