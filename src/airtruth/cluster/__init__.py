"""Work on many machines: a Dask scheduler, the check of its workers, and a map over them."""

from airtruth.cluster.client import Cluster, LostWorkError, connected, workers

__all__ = ["Cluster", "LostWorkError", "connected", "workers"]
