"""Discretisation, zero-phase filters, intersample behaviour, transfer functions and the Levenberg-Marquardt solver."""
