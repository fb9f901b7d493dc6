"""Campaigns: the file, the plan with every random draw, chunks of runs, and the resumable run."""
