"""Survey of a JSBSim model of unknown origin: its controls, engines, augmentation, and where it can fly.

`task` runs in a disposable process; the other modules are its steps.
"""
