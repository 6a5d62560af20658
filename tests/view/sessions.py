"""Recorded sessions for tests: written by the session's own writer, from frames that nobody had to simulate."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import otwarp as ot
from otwarp.haptics.core.config import HapticsConfig
from otwarp.teleop import LiveFrame
from otwarp.teleop.recording import RecordingWriter
from tests.view.runs import RATE, frames

COUNT = 90


def session(path: Path, scene: ot.Scene, close: bool = True) -> RecordingWriter:
    """A session of `COUNT` frames without hands, whose clock shows 100 s at the beginning."""
    writer = RecordingWriter(
        path, config=HapticsConfig(), devices={}, laws={}, kinds=(), scene=scene, clock=lambda: 100.0
    )
    for n, frame in enumerate(frames(scene, COUNT)):
        writer.frame(LiveFrame(beat=n + 1, wall=100.0 + n / RATE, frame=frame, hand_force=np.zeros((2, 3))))
    if close:
        writer.close()
    return writer
