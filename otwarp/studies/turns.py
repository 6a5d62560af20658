"""Batches of trials that share a GPU: one takes its steps while the host sets the next one up."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, contextmanager


class Turns:
    """Whose turn it is on a device: one batch at a time is set up, and one takes its steps.

    Threads that compute a batch each so become a pipeline, and none of them waits longer for the device than without
    the others: steps of two batches side by side would take as long as one after the other, and end together.

    Args:
        batches: How many share the device and its memory.
    """

    def __init__(self, batches: int = 1):
        self.batches = batches
        self._setup, self._steps = threading.Lock(), threading.Lock()
        self._over = False

    def setup(self) -> AbstractContextManager[None]:
        """While a batch is set up.

        Raises:
            CancelledError: `end` was called.
        """
        return self._turn(self._setup)

    def steps(self) -> AbstractContextManager[None]:
        """While a batch takes its steps; errors as `setup`."""
        return self._turn(self._steps)

    def end(self) -> None:
        """Let all give up, at their next turn or look: after an error or an interrupt nobody asks for their results."""
        self._over = True

    def check(self) -> None:
        """Raise `CancelledError` if `end` was called."""
        if self._over:
            raise CancelledError

    @contextmanager
    def _turn(self, lock: threading.Lock) -> Iterator[None]:
        with lock:
            self.check()
            yield
