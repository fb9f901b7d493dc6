"""Perform one trace task: pickled on standard input, how it ended pickled on standard output."""

from __future__ import annotations

import os
import pickle
import sys

from airtruth.api.trace_tasks import attempt


def main() -> None:
    """Read the task, perform it, and write how it ended; nothing that JSBSim prints joins the reply."""
    task = pickle.loads(sys.stdin.buffer.read())
    with os.fdopen(os.dup(1), "wb") as reply, open(os.devnull, "wb") as silence:
        os.dup2(silence.fileno(), 1)
        pickle.dump(attempt(task), reply)


if __name__ == "__main__":
    main()
