"""Where the command begins: Ctrl-C ends it from the first moment on, before anything slow is imported."""

from __future__ import annotations

import gc
import signal
import sys

from otwarp.cli import stop


def start() -> int:
    """Run the command line; the exit code."""
    # imports and kernels make 200,000 objects that stay: looking through them for cycles took a tenth of a start
    gc.set_threshold(50_000, 20, 50)
    try:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not what runs in a shell's background
            signal.signal(signal.SIGINT, stop.interrupt)
            stop.forget_at_the_end()
        from otwarp.cli.main import main

        return stop.leave(main())
    except KeyboardInterrupt:  # before `main` catches it, or after
        stop.answered = True
        print("otwarp: interrupted", file=sys.stderr)
        return stop.leave(stop.EXIT_INTERRUPTED)
