"""Posterior, optimiser, robust covariance, profile likelihood and assessment of held-out records."""
