"""Experiments behind the documents; each prints its tables (`make study`)."""
