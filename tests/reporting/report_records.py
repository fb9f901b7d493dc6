"""Records beside simulations, and folders of results with them, from formulas: pages without a flight or a trace."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from airtruth.charts import Line, Panel
from airtruth.logs.histories import FILE, Histories, History, write_histories
from airtruth.logs.provenance import PROVENANCE, Provenance
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.trace_histories import PANEL
from validation.linear_flight import GTM, as_log, fly

SAMPLE = json.loads((Path(__file__).parent / "trace_sample.json").read_text())
STAGES = ("declared", "before", "after")
METHODS = ("ls", "iv-f1")


def record(run_id="r1", group="fitted", samples=301, dt_s=0.02, models=STAGES):
    """A decaying oscillation; each model is nearer to it than the one before."""
    t = dt_s * np.arange(samples)
    elevator = np.where((t > 1.0) & (t < 1.5), 0.035, 0.0) - np.where((t >= 1.5) & (t < 2.0), 0.035, 0.0)
    motion = np.where(t > 1.0, np.exp(-1.2 * (t - 1.0)) * np.sin(6.0 * (t - 1.0)), 0.0)
    scales = {"alpha_rad": 0.04, "q_rad_s": 0.2, "az_m_s2": 3.0}
    ripple = 0.05 * np.sin(31.0 * t + sum(map(ord, run_id)))
    measured = {c: scale * (motion + ripple) for c, scale in scales.items()}
    shares = np.linspace(0.5, 0.95, len(models))
    return History(
        run_id=run_id,
        group=group,
        t_s=t,
        controls_rad={"elevator_rad": elevator},
        measured=measured,
        models={
            m: {c: x * scale * motion for c, scale in scales.items()}
            for m, x in zip(models, shares, strict=True)
        },
        innovations={m: {c: np.cos(17.0 * t * (1.0 + i)) for c in scales} for i, m in enumerate(models)},
        effect={c: 0.3 * scale * motion for c, scale in scales.items()},
        floor={c: 0.06 * scale for c, scale in scales.items()},
        conditions={
            "airspeed_m_s": 42.85,
            "density_kg_m3": 0.9931,
            "mass_kg": 26.195,
            "duration_s": float(t[-1]),
        },
    )


def histories(records=6, samples=301, models=STAGES):
    names = [*SAMPLE["records"]["fitted"], *SAMPLE["records"]["held_out"]][:records]
    names += [f"x{k}" for k in range(records - len(names))]
    groups = ["held out" if name in SAMPLE["records"]["held_out"] else "fitted" for name in names]
    own = tuple(record(n, g, samples, models=models) for n, g in zip(names, groups, strict=True))
    panel = Panel(
        "the effect: Cm", "elevator [deg]", "Cm", lines=(Line((-5.0, 0.0, 5.0), (0.1, 0.0, -0.06), "after"),)
    )
    facts = {
        PANEL: {**asdict(panel), "lines": [asdict(one) for one in panel.lines]},
        PROVENANCE: Provenance("1.2.3", "gtm", {"model": "aircraft"}, {"a.parquet": "ab" * 32}).to_dict(),
    }
    return Histories(own, models, own[-1].run_id, len(own), facts)


def declared_model():
    shifts = {
        name: {
            "declared": -1.0,
            "declared_std": 0.1,
            "estimate": -1.0 + 0.1 * k,
            "std": 0.02,
            "ci95": [-1.04 + 0.1 * k, -0.96 + 0.1 * k],
            "sigma": float(k),
        }
        for k, name in enumerate(LONGITUDINAL.parameters)
    }
    return {
        "consistent": False,
        "statistic": 55.0,
        "degrees": 6,
        "p_value": 3e-10,
        "shifts": shifts,
        "where": "derivatives",
    }


def answer():
    return TraceAnswer.from_dict({**SAMPLE, "declared_model": declared_model()})


def trace_folder(folder, **changes):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "trace.json").write_text(answer().to_json())
    write_histories(folder / FILE, histories(**changes))
    return folder


def loop_folder(folder):
    trace_folder(folder / "trace")
    rows = [
        {
            "method": method,
            "derivative": name,
            "declared": -1.0,
            "before": -0.9,
            "before_error": 0.02,
            "after": -0.99,
            "after_error": 0.01,
            "runs_before": 6,
            "runs_after": 6,
            "declared_same_inputs": -0.95,
            "corrected_same_inputs": -0.98,
            "difference": -0.04,
            "difference_error": 0.01,
            "remaining": -0.01,
            "remaining_error": 0.01,
            "runs_compared": 6,
        }
        for method in METHODS
        for name in LONGITUDINAL.parameters
    ]
    document = {
        "trace": answer().to_dict(),
        "treatments": [
            {"effect": "gyro_lag", "kind": "undone", "sentence": "gyro_lag: the lag of q is undone"}
        ],
        "estimates": rows,
    }
    (folder / "loop.json").write_text(json.dumps(document))
    return folder


def log(runs=3):
    """Runs of the linear short period in light gusts."""
    return as_log(fly(runs=runs, gust=1.0, noise=1.0, seed=71))


__all__ = ["GTM", "METHODS", "STAGES", "answer", "histories", "log", "loop_folder", "record", "trace_folder"]
