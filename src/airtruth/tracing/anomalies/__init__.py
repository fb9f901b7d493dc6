"""Tests whether a fit lacks anything: scores of effects, and omnibus tests that name none."""
