"""Damaged inputs: every reader of airtruth answers each of them with a result or one sentence."""
