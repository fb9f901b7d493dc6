"""Effects that a declared model may lack, as data: parameters, ranges, material sizes and the terms that they change.

Simulation, tracing and the aircraft writer read the same description (`airtruth.physics.terms.Change`).
"""
