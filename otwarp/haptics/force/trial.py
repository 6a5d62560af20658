"""A trial of a compiled law before a hand is given to it: in a process of its own, against the law in plain Python.

A loader that has changed, memory that may not be executed, code for another processor: what would end the servo ends
the trial, and the servo then runs the Python law. So does one bit of difference.
"""

from __future__ import annotations

import os
import pickle
import random
import subprocess
import sys
from collections.abc import Mapping, Sequence

from otwarp.errors import InputError
from otwarp.haptics.core.types import SceneFrame, SphereFrame, TrapFrame, Vec3
from otwarp.haptics.force.compiled import CompiledLaw, CompiledModel
from otwarp.haptics.force.law import Law, LocalModel

WITHIN = 60.0
"""Seconds that a trial may take; a cold disk and a busy machine take some of the second that it needs."""
STATES, PLACES = 20, 5
"""States that are told to both models, and places of the hand in each."""


def tried(code: CompiledLaw, laws: Mapping[int, Sequence[Law]]) -> str:
    """Why the code must not be used for these laws, or ""."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-c", "from otwarp.haptics.force.trial import child; child()"]
    order = pickle.dumps((code, dict(laws)))
    try:
        done = subprocess.run(command, input=order, capture_output=True, env=environment, timeout=WITHIN, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"its trial failed ({error})"
    said = done.stdout.decode(errors="replace").strip()
    return said if done.returncode == 0 else said or f"its trial ended with {done.returncode}"


def child() -> None:
    """What the process of a trial does: an order from stdin, a line about what is wrong to stdout."""
    code, laws = pickle.loads(sys.stdin.buffer.read())
    try:
        print(difference(code, laws))
    except InputError as error:
        print(error)


def difference(code: CompiledLaw, laws: Mapping[int, Sequence[Law]], seed: int = 0) -> str:
    """How the compiled model differs from the Python one on random states and places, or ""."""
    rng, kinds = random.Random(seed), tuple(range(len(next(iter(laws.values()))))) * 3
    for prediction, smoothing in ((False, 1.0), (True, 0.3)):
        how = {"prediction": prediction, "smoothing": smoothing}
        plain, compiled = LocalModel(laws, kinds, **how), CompiledModel(laws, kinds, code=code, **how)
        for beat in range(STATES):
            scene = _scene(rng, beat, len(kinds), laws)
            hold = {trap: _vector(rng, 0.1) for trap in laws}
            for model in (plain, compiled):
                model.refresh(scene, hold)
            for _ in range(PLACES):
                carried = _vector(rng, 0.5)
                one, other = plain.force(*carried), compiled.force(*carried)
                if one != other:
                    return f"it gives {other} pN where Python gives {one}"
            if plain.state() != compiled.state():
                return "it moves spheres otherwise than Python"
    return ""


def _scene(rng: random.Random, beat: int, spheres: int, laws: Mapping[int, Sequence[Law]]) -> SceneFrame:
    """Traps near the origin and spheres about them, some on it and some far."""
    places = [_vector(rng, rng.choice((0.0, 0.3, 1.0, 3.0))) for _ in range(spheres)]
    traps = tuple(TrapFrame(trap, _vector(rng, 0.3), rng.uniform(1.0, 50.0)) for trap in laws)
    return SceneFrame(beat, 0.008 * beat, tuple(SphereFrame(place, n) for n, place in enumerate(places)), traps)


def _vector(rng: random.Random, size: float) -> Vec3:
    return rng.gauss(0.0, size), rng.gauss(0.0, size), rng.gauss(0.0, size)
