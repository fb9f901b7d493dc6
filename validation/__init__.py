"""Blind trials and an independent replay: written without the effects, estimators and tracer that they test."""
