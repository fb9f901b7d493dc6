"""The first steps: commented files to start from, and the examples that come with airtruth."""

from airtruth.starting.examples import EXAMPLES, Example, copy_example, data_root
from airtruth.starting.geometry import Measured, ProposedAircraft, proposed_aircraft
from airtruth.starting.texts import CONDITIONS, aircraft_text, campaign_text, mapping_text

__all__ = [
    "CONDITIONS",
    "EXAMPLES",
    "Example",
    "Measured",
    "ProposedAircraft",
    "aircraft_text",
    "campaign_text",
    "copy_example",
    "data_root",
    "mapping_text",
    "proposed_aircraft",
]
