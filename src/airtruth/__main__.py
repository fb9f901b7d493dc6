"""The program: `airtruth`, and python -m airtruth."""

import signal
import sys


def main() -> None:
    """Import the command line and run it; Ctrl-C during the imports ends the program without a traceback."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from airtruth.cli import main as run

    run()


if __name__ == "__main__":
    if not sys.flags.safe_path and sys.path and not __file__.startswith(sys.path[0] + "/"):
        del sys.path[0]  # `python -m` puts the working folder there, whose files must not be imported
    main()
