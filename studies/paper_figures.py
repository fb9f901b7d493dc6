"""Figures of a flight, of the paper's filters (its Fig. 1) and of outputs against the model (its Fig. 4).

Each function takes arrays and returns a matplotlib figure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from airtruth import style, units

Array = NDArray[np.float64]

_FLIGHT_PANELS: Final = (
    ("elevator_command_rad", "elevator\ncommand [deg]", units.DEG),
    ("elevator_rad", "elevator\n[deg]", units.DEG),
    ("alpha_rad", "angle of attack\n[deg]", units.DEG),
    ("q_rad_s", "pitch rate\n[deg/s]", units.DEG),
    ("az_m_s2", "normal specific\nforce [m/s²]", 1.0),
)
"""Panels of a flight: channel, label, and SI value of the label's unit."""

_OUTPUT_PANELS: Final = (
    (r"$y_1=\dot\alpha-q$ [deg/s]", units.DEG),
    (r"$y_2=\dot q$ [deg/s²]", units.DEG),
    (r"$y_3=a_z$ [g]", 1.0),
)
"""Panels of the outputs: label, and SI value of its unit."""


@dataclass(frozen=True)
class OutputFit:
    """Outputs y = X theta + nu of the paper's eq. (4) over one record.

    Attributes
    ----------
    measured, estimated : (3, samples) alpha_dot - q [rad/s], q_dot [rad/s2], az - az_trim [g].
    bound : (3, samples) or (3, 1) half width of the error bounds, 3 standard deviations.
    """

    measured: Array
    estimated: Array
    bound: Array


def flight(time_s: Array, versions: Mapping[str, Mapping[str, Array]], title: str = "") -> Figure:
    """Draw command, elevator, angle of attack, pitch rate and normal force of one run.

    Parameters
    ----------
    time_s : (samples,) time [s].
    versions : legend text ("measured", "noise-free", "calm air") -> channel of `airtruth.channels` ->
        (samples,) values in SI. At most six; the first is drawn as dots below the others. A channel that
        no version has gets no panel.
    title : heading, "" for none.
    """
    panels = [p for p in _FLIGHT_PANELS if any(p[0] in channels for channels in versions.values())]
    looks: list[dict[str, Any]] = [
        {"color": style.GREY, "ls": "", "marker": ".", "ms": 3.5, "mew": 0.0},
        {"color": style.BLUE, "lw": 1.3},
        {"color": style.VERMILLION, "lw": 1.3, "ls": "--"},
        *({"color": colour, "lw": 1.3, "ls": ":"} for colour in style.PALETTE[2:]),
    ]
    with style.applied():
        figure = style.new_figure(7.2, 0.9 + 1.35 * len(panels))
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (name, label, unit) in zip(axes, panels, strict=True):
            for (version, channels), look in zip(versions.items(), looks, strict=False):
                if name in channels:
                    ax.plot(time_s, channels[name] / unit, label=version, **look)
            ax.set_ylabel(label)
            ax.margins(x=0.01)
        axes[-1].set_xlabel("time [s]")
        figure.align_ylabels(list(axes))
        style.legend_above(figure, axes, title)
    return figure


def filter_responses(a: Array, b: Array, omega_rad_s: Array) -> tuple[Array, Array]:
    """Return the complex frequency responses of f1_0 = 1/Delta (eq. 7) and of f2_0 = |q/de| (eq. 8).

    q/de = (b2 p + a21 b1 - a11 b2)/Delta, Delta = p^2 - tr(A) p + det(A). Its gain k_q = b2 is negative;
    the sign cancels in the estimate and is omitted, as in the paper's figure, whose phase starts at 0.

    Parameters
    ----------
    a, b : (2, 2) and (2,) state and input matrix of the state [alpha, q] (`short_period.system`).
    omega_rad_s : (n,) angular frequency [rad/s].
    """
    p = 1j * omega_rad_s
    delta = p**2 - np.trace(a) * p + np.linalg.det(a)
    numerator = b[1] * p + (a[1, 0] * b[0] - a[0, 0] * b[1])
    return 1.0 / delta, np.sign(b[1]) * numerator / delta


def filters(a: Array, b: Array, title: str = "") -> Figure:
    """Draw the frequency responses of the dynamic filters f1_0 and f2_0, as in the paper's Fig. 1.

    Parameters
    ----------
    a, b : (2, 2) and (2,) state and input matrix of the state [alpha, q].
    title : heading, "" for none.
    """
    omega = np.logspace(-1.0, 3.0, 801)
    with style.applied():
        figure = style.new_figure(6.4, 5.0)
        magnitude, phase = figure.subplots(2, 1, sharex=True)
        for response, label, colour, line in zip(
            filter_responses(a, b, omega),
            (r"$f^1_0=1/\Delta$", r"$f^2_0=|k_q|\,(p+1/T_{\theta_2})/\Delta$"),
            (style.BLUE, style.VERMILLION),
            ("-", "--"),
            strict=True,
        ):
            magnitude.semilogx(omega, 20.0 * np.log10(np.abs(response)), line, color=colour, label=label)
            phase.semilogx(omega, np.unwrap(np.angle(response)) / units.DEG, line, color=colour)
        magnitude.set_ylabel("magnitude [dB]")
        phase.set_ylabel("phase [deg]")
        phase.set_yticks(np.arange(-180.0, 91.0, 45.0))
        phase.set_xlabel("angular frequency [rad/s]")
        phase.margins(x=0.01)
        figure.align_ylabels([magnitude, phase])
        style.legend_above(figure, [magnitude], title)
    return figure


def outputs(time_s: Array, fits: Mapping[str, OutputFit], title: str = "") -> Figure:
    """Draw measured outputs against estimated ones with 3 sigma bounds, as in the paper's Fig. 4.

    Parameters
    ----------
    time_s : (samples,) time [s].
    fits : heading of a column (a method) -> outputs.
    title : heading, "" for none.
    """
    with style.applied():
        figure = style.new_figure(1.2 + 3.4 * len(fits), 6.2)
        axes = figure.subplots(3, len(fits), sharex=True, sharey="row", squeeze=False)
        for column, (method, fit) in zip(axes.T, fits.items(), strict=True):
            column[0].set_title(method)
            column[-1].set_xlabel("time [s]")
            for i, (ax, (_, unit)) in enumerate(zip(column, _OUTPUT_PANELS, strict=True)):
                low, high = (fit.estimated[i] - fit.bound[i]) / unit, (fit.estimated[i] + fit.bound[i]) / unit
                ax.fill_between(
                    time_s, low, high, color=style.SKY, alpha=0.35, lw=0.0, label=r"error bounds (3$\sigma$)"
                )
                ax.plot(time_s, fit.measured[i] / unit, color=style.BLACK, lw=0.9, label="measurement")
                ax.plot(
                    time_s,
                    fit.estimated[i] / unit,
                    "--",
                    color=style.VERMILLION,
                    lw=1.5,
                    label="estimated output",
                )
                ax.margins(x=0.01)
        for ax, (label, _) in zip(axes[:, 0], _OUTPUT_PANELS, strict=True):
            ax.set_ylabel(label)
        figure.align_ylabels(list(axes[:, 0]))
        style.legend_above(figure, axes[0], title)
    return figure
