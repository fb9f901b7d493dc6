"""Functions that run in a disposable process: a crash, a hang or an excess of theirs ends nothing else."""
