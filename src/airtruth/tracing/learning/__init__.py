"""Increments without a physical name, learned from what the effects of an answer leave."""
