"""Least squares, instrumental variables and equation error in the frequency domain."""
