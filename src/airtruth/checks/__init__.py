"""The gate that every log passes, and the flight-path reconstruction behind `airtruth check`."""
