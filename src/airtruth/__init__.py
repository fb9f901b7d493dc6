"""airtruth: fly a flight test in JSBSim, identify the aircraft from its logs, close the loop."""

__version__ = "0.1.0"
