"""Servers of the S3 protocol and of Google Cloud Storage, a bucket for each test, and a campaign beside them."""

from campaigns import campaign, local
from conftest_stores import bucket, google_bucket, s3_server

__all__ = ["bucket", "campaign", "google_bucket", "local", "s3_server"]
