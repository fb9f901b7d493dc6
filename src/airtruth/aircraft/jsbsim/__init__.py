"""Readers and writers of JSBSim models."""
