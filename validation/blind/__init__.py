"""Blind trials: an own truth, flown in JSBSim; its information; the scoring of what a tracer answers.

Nothing here but `tracing` imports `airtruth.effects`, `airtruth.identification` or `airtruth.tracing`.
"""
