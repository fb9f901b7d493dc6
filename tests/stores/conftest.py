"""A server of the S3 protocol for each test process, and a bucket for each test."""

from conftest_stores import bucket, s3_server

__all__ = ["bucket", "s3_server"]
