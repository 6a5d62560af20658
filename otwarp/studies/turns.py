"""Batches of trials that share a GPU: one takes its steps while the host sets the next one up."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager


class Turns:
    """Whose turn it is on a device: one batch at a time is set up, and one takes its steps.

    Threads that compute a batch each so become a pipeline. Steps of two side by side would take as long as one after
    the other, and end together, so that nothing were left to hide a set-up behind.
    """

    def __init__(self) -> None:
        self._setup, self._steps = threading.Lock(), threading.Lock()
        self._over = False

    @contextmanager
    def setup(self) -> Iterator[None]:
        """While a batch is set up.

        Raises:
            CancelledError: `end` was called.
        """
        with self._setup:
            self.check()
            yield

    @contextmanager
    def steps(self) -> Iterator[None]:
        """While a batch takes its steps; errors as `setup`."""
        with self._steps:
            self.check()
            yield

    def end(self) -> None:
        """Let all give up, at their next turn or look: after an error or an interrupt nobody asks for their results."""
        self._over = True

    def check(self) -> None:
        """Raise `CancelledError` if `end` was called."""
        if self._over:
            raise CancelledError
