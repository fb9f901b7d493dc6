"""The tables and figures of M. Brunot's paper, beside the published values."""
