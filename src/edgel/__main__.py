"""Run the command line: ``edgel``, or ``python -m edgel``."""

import os
import signal


def main() -> None:
    """Run a command; Ctrl-C while its modules are still being imported ends it at once."""
    early = [number for number in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(number) is not signal.SIG_IGN]
    for number in early:
        signal.signal(number, lambda number, frame: os._exit(128 + number))
    from edgel._cli.program import run

    run()


if __name__ == "__main__":
    main()
