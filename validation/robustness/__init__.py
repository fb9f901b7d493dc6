"""Kills of commands and damages of campaigns: nothing is lost, nothing is left, nothing goes unnoticed."""
