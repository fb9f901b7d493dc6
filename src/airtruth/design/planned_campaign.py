"""The campaign file that a planned input is written as, and the panel of the input."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airtruth.design.limits import Extremes, Limits
from airtruth.logs.atomic import write_text
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.write import as_toml
from airtruth.simulation.simulator import Condition
from airtruth.units import DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PlannedCampaign(ABC):
    """Common part of every result of `airtruth plan` that computes an input.

    Attributes
    ----------
    aircraft : name.
    campaign : flies the computed input; reference_campaign : the same with the 3-2-1-1.
    limits, reached : limits, and what the aircraft reaches in calm air, as declared and with the changes allowed for.
    condition : flight condition.
    gust_m_s : vertical gust that is expected [m/s].
    tried : inputs that were flown.
    """

    aircraft: str
    campaign: Campaign
    reference_campaign: Campaign
    limits: Limits
    reached: Extremes
    condition: Condition
    gust_m_s: float
    tried: int

    @abstractmethod
    def _notes(self) -> tuple[str, ...]:
        """Sentences on the input, for the head of the file."""

    def _flight_dict(self) -> dict[str, Any]:
        """Aircraft, campaign, flight condition, gust, limits, and what is reached."""
        return {
            "aircraft": self.aircraft,
            "campaign": self.campaign.name,
            "records": self.campaign.runs,
            "condition": asdict(self.condition),
            "gust_m_s": self.gust_m_s,
            "limits": self.limits.to_dict(),
            "reached": asdict(self.reached),
        }

    def to_toml(self) -> str:
        """Text of the campaign file."""
        title = self.campaign.title
        lines = [f"{title[:1].upper()}{title[1:]}, computed by airtruth plan.", *self._notes()]
        return as_toml(self.campaign, "\n".join(lines))

    def write(self, out: Path) -> None:
        """Write the campaign file.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        write_text(out, self.to_toml())


def draw_input(ax: Axes, t_s: Array, reference_rad: Array, surface_rad: Array, family: str) -> None:
    """Draw the computed input beside the 3-2-1-1 of equal length; the caller draws the legend, where it hides neither.

    Parameters
    ----------
    t_s, reference_rad, surface_rad : (samples,) time [s] and both inputs [rad].
    family : of the computed input.
    """
    from airtruth import style

    ax.plot(t_s, reference_rad / DEG, "--", color=style.GREY, label="3-2-1-1 of equal length")
    ax.plot(t_s, surface_rad / DEG, color=style.BLUE, label=family)
    ax.set_ylabel(f"{LONGITUDINAL.controls[0].name} [deg]")


__all__ = ["PlannedCampaign", "draw_input"]
