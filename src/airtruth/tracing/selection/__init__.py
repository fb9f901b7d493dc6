"""The search: the evidence of every set of effects, and the set that an answer states."""
