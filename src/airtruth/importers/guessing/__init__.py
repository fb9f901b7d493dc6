"""A proposal for a mapping: the assignment of columns to channels that names, units and physics agree on."""
