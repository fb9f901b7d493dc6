"""Users of moto's server with and without permission to write."""

from __future__ import annotations

import json

REQUESTS = 7
"""Requests of `users`, which need no permission."""


def users(address: str, bucket: str) -> tuple[tuple[str, str], tuple[str, str]]:
    """Make a bucket and two users; return the access key and the secret of one that reads and of one that also writes."""
    import boto3

    common = {"endpoint_url": address, "region_name": "us-east-1"}
    common |= {"aws_access_key_id": "root", "aws_secret_access_key": "root"}
    iam = boto3.client("iam", **common)
    boto3.client("s3", **common).create_bucket(Bucket=bucket)
    keys = []
    for name, actions in (("reader", ["s3:Get*", "s3:List*", "s3:HeadBucket"]), ("writer", ["s3:*"])):
        iam.create_user(UserName=name)
        policy = {
            "Version": "2012-10-17",
            "Statement": [{"Effect": "Allow", "Action": actions, "Resource": "*"}],
        }
        iam.put_user_policy(UserName=name, PolicyName=name, PolicyDocument=json.dumps(policy))
        made = iam.create_access_key(UserName=name)["AccessKey"]
        keys.append((made["AccessKeyId"], made["SecretAccessKey"]))
    return keys[0], keys[1]
