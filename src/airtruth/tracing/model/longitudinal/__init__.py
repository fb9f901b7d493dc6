"""The pitch plane in the filter: inputs, equations, their derivatives, and forces beyond the tables."""
