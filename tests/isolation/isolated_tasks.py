"""What the tests let a disposable process do."""

import os
import sys
import time

import numpy as np

from airtruth.errors import StoreError
from airtruth.isolation.protocol import Reply


def echo(**facts):
    return Reply(
        facts, (np.arange(6.0).reshape(2, 3), np.array(["a", "bc"]), np.zeros((0, 2), dtype=np.int16))
    )


def die():
    os.abort()


def hang():
    while True:
        pass


def sleep():
    time.sleep(60.0)


def fill():
    return Reply({}, (np.ones(10**9),))


def refuse():
    raise StoreError("f.csv: is refused")


def fail():
    return 1 / 0


def half():
    sys.setrecursionlimit(10)
    os._exit(0)


def surroundings():
    return Reply({"path": sys.path, "folder": os.getcwd(), "process": os.getppid()})
