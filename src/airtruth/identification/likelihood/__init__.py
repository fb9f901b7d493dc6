"""Filter error and output error by maximum likelihood, and the Cramer-Rao bound."""
