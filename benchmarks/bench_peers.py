"""The same records through airtruth and AeroID: RMSE, coverage, failures, time.

Records of 5 s at 50 Hz of the linear GTM, 2 deg doublet, u and w gusts at twice the light level, GTM sensors,
no airspeed. AeroID 0.5.0 is given what helps it: the estimates of iv-f1 to start from, the true noise of the
sensors, and for its filter error the true gusts, as noise on alpha and q alone ("2 states") or as a
state of their own written by hand ("gust state"). airtruth is given the log alone. Times are CPU of one core.

    pip install airtruth[bench]; python -m benchmarks.bench_peers [RECORDS]
"""

from __future__ import annotations

import importlib.util
import math
import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from airtruth.identification import Options, identify_batch, quantities
from airtruth.identification.likelihood.cramer_rao import experiment_bound
from airtruth.identification.likelihood.options import FilterOptions
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import G0
from validation.linear_flight import AIRSPEED_M_S, GTM, LIGHT, NOISE, THETA, fly, gtm_scale

Array = NDArray[np.float64]

GUST = 2.0
RECORDS = 4
CONSTANT = Options(pressure="constant")
OURS = ("ls", "iv-f1", "iv-refined", "output-error", "filter-error")
OUTPUTS = ("alpha", "q", "az")
QUIET_S = 0.9


def line(title: str, theta: Array, std: Array, good: Array, least: Array, seconds: float) -> None:
    """One method: RMSE over the bound, coverage and failures."""
    error, half = (theta - THETA)[good], 1.96 * std[good]
    over = np.sqrt((error**2).mean(axis=0)) / least
    inside = 100.0 * (np.abs(error) < half).mean(axis=0)
    mean = math.exp(np.log(over).mean())
    print(
        title.ljust(30)
        + "".join(f"{v:8.2f}" for v in over)
        + f"{mean:8.2f}{inside.min():7.0f} to{inside.max():4.0f}{(~good).sum():8d}{1e3 * seconds / good.size:10.1f}"
    )


def ours(batch: Batch, least: Array) -> Array:
    """Print airtruth's methods; the estimates of iv-f1."""
    for name in OURS:
        identify_batch(batch, GTM, name, CONSTANT)  # compiles
        begun = time.process_time()
        estimates = identify_batch(batch, GTM, name, CONSTANT)
        spent = time.process_time() - begun
        std = quantities(estimates).std[:, :6]
        line(f"airtruth {name}", estimates.theta, std, estimates.converged, least, spent)
    return identify_batch(batch, GTM, "iv-f1", CONSTANT).theta


def peer_model(gust_state: bool) -> object:
    """The short period for AeroID, biases of the outputs among its parameters."""
    import aeroid

    s = gtm_scale()
    lift, moment, normal, half = (float(x) for x in (s.lift, s.moment, s.normal, s.half_chord_time))
    fade = AIRSPEED_M_S / LIGHT[3]

    def forces(x: Array, de: float, p: dict[str, float]) -> tuple[float, float, float]:
        air = x[0] + (x[2] / AIRSPEED_M_S if gust_state else 0.0)
        cl = p["CLalpha"] * air + p["CLq"] * half * x[1] + p["CLde"] * de
        return air, cl, p["Cmalpha"] * air + p["Cmq"] * half * x[1] + p["Cmde"] * de

    def dynamics(t: float, x: Array, u: Array, p: dict[str, float]) -> list[float]:
        _, cl, cm = forces(x, u[0], p)
        return [x[1] - lift * cl, moment * cm, *([-fade * x[2]] if gust_state else [])]

    def measurement(t: float, x: Array, u: Array, p: dict[str, float]) -> list[float]:
        air, cl, _ = forces(x, u[0], p)
        return [air + p["b_alpha"], x[1] + p["b_q"], -normal * cl + p["b_az"]]

    return aeroid.Model(
        states=("path", "rate", *(("gust",) if gust_state else ())),
        controls=("elevator",),
        parameters=dict.fromkeys((*LONGITUDINAL.parameters, *(f"b_{n}" for n in OUTPUTS)), 0.0),
        dynamics=dynamics,
        outputs=OUTPUTS,
        measurement=measurement,
    )


def peer_data(batch: Batch, run: int) -> object:
    """One record relative to its quiet start."""
    import aeroid

    quiet = round(QUIET_S / batch.dt_s)
    names = {"alpha": "alpha_rad", "q": "q_rad_s", "az": "az_m_s2", "elevator": "elevator_rad"}
    signals = {n: batch.channels[c][run] - batch.channels[c][run, :quiet].mean() for n, c in names.items()}
    return aeroid.FlightData(time=batch.t_s[run], channels=signals)


def noise_psd(gust_state: bool) -> dict[str, float]:
    """Process noise: the gust w about itself, or what it does to alpha and q within a second."""
    sigma_w, sigma_u = GUST * LIGHT[1], GUST * LIGHT[0]
    u = (2.0 * G0 * sigma_u / AIRSPEED_M_S**2) ** 2
    if gust_state:
        return {"path": u, "rate": 1e-8, "gust": 3.0 * sigma_w**2 * AIRSPEED_M_S / LIGHT[3]}
    w = sigma_w**2 * 3.0 / (AIRSPEED_M_S * LIGHT[3])
    s = gtm_scale()
    return {"path": u + w, "rate": float((s.moment * THETA[3]) ** 2) * w}


def peer(title: str, batch: Batch, start: Array, least: Array, method: str, gust_state: bool) -> None:
    """One method of AeroID, record by record."""
    import aeroid

    model = peer_model(gust_state)
    states = 3 if gust_state else 2
    if method == "filter_error":
        variance = {n: s**2 for n, s in zip(OUTPUTS, NOISE[:3], strict=True)}
        # lift in a gust u that its model has no state for
        variance["az"] += (2.0 * G0 * GUST * LIGHT[0] / AIRSPEED_M_S) ** 2 * 0.05
        psd = noise_psd(gust_state)
        more = {"process_noise": psd, "measurement_noise": variance}
        more["filter_options"] = {"P0": dict.fromkeys(psd, 1e-6) | ({"gust": 0.1} if gust_state else {})}
    else:
        more = {"weights": {n: 1.0 / s for n, s in zip(OUTPUTS, NOISE[:3], strict=True)}}
    runs = len(batch.run_ids)
    theta, std, good = np.full((runs, 6), np.nan), np.full((runs, 6), np.nan), np.zeros(runs, dtype=bool)
    begun = time.process_time()
    for run in range(runs):
        guess = dict(zip(LONGITUDINAL.parameters, start[run], strict=True))
        guess |= {"b_alpha": 1e-3, "b_q": 1e-3, "b_az": 1e-1}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = aeroid.identify(
                    model,
                    peer_data(batch, run),
                    tuple(guess),
                    method=method,
                    initial_guess=guess,
                    x0=np.zeros(states),
                    **more,
                )
        except aeroid.AeroidError:
            continue
        theta[run] = [found.parameters[n] for n in LONGITUDINAL.parameters]
        std[run] = [found.stderr[n] for n in LONGITUDINAL.parameters]
        good[run] = found.success
    line(title, theta, std, good, least, time.process_time() - begun)


def main() -> None:
    records = int(sys.argv[1]) if len(sys.argv) > 1 else RECORDS
    levels = (*NOISE[:3], LIGHT[0] * GUST, LIGHT[1] * GUST, LIGHT[2], LIGHT[3])
    least = np.sqrt(np.diag(experiment_bound(fly(), GTM, THETA, FilterOptions(*levels))[0]))
    batch = fly(runs=records, gust=GUST, noise=1.0, seed=61)
    print(f"\nPeers on {records} records, {GUST:g} x light: RMSE over the Cramer-Rao bound")
    heads = "".join(f"{n:>8s}" for n in LONGITUDINAL.parameters)
    print(f"{'':30s}{heads}    mean  coverage %  failed ms/record")
    start = ours(batch, least)
    if importlib.util.find_spec("aeroid") is None:
        print("AeroID is not installed: its rows are left out; pip install airtruth[bench] brings it.")
        return
    rows: tuple[tuple[str, Callable[[], None]], ...] = (
        ("output error", lambda: peer("AeroID output error", batch, start, least, "output_error", False)),
        (
            "two states",
            lambda: peer("AeroID filter error, 2 states", batch, start, least, "filter_error", False),
        ),
        (
            "gust state",
            lambda: peer("AeroID filter error, gust state", batch, start, least, "filter_error", True),
        ),
    )
    for _, row in rows:
        row()


if __name__ == "__main__":
    main()
