"""Shared memory that has all its pages, or is refused; a full /dev/shm used to end the writer with SIGBUS."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.haptics.core.named_memory import PLACE, create_memory
from otwarp.haptics.core.shared_memory import Mailbox, Ring
from otwarp.haptics.servo.link import HandSetup, SceneLayout
from otwarp.haptics.servo.process import ServoProcess
from tests.haptics.spring import SpringChain

ROOT = Path(__file__).resolve().parents[3]
SMALL = 256 * 1024
"""Bytes of the small /dev/shm: the boxes of a servo fit, its ring of 8000 cycles of 208 bytes does not."""

linux = pytest.mark.skipif(sys.platform != "linux", reason="/dev/shm is Linux's")


def names() -> set[str]:
    return {file.name for file in PLACE.iterdir()} if PLACE.is_dir() else set()


@linux
def test_every_page_is_there_when_it_is_made():
    memory = create_memory("a test", 1 << 20)
    try:
        assert (PLACE / memory.name).stat().st_blocks * 512 >= 1 << 20  # a sparse one has none
    finally:
        memory.close()
        memory.unlink()


@linux
def test_no_room_is_one_line_with_path_need_and_free_space_and_leaves_nothing(monkeypatch):
    def full(fd: int, offset: int, size: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = names()
    monkeypatch.setattr(os, "posix_fallocate", full)
    says = r"shared memory for {}: /dev/shm needs {} bytes, \d+ are free \(No space left on device\); .*--shm-size"
    for make, what, size in (
        (lambda: create_memory("a test", 4711), "a test", "4711"),
        (lambda: Mailbox.create(SceneLayout(4, 4)), "the scene mailbox", r"\d+"),
        (lambda: Ring.create(100), "a ring of 100 cycles", r"\d+"),
        (lambda: ServoProcess([HandSetup("virtual:hold", SpringChain)], spheres=1, traps=1), ".*", r"\d+"),
    ):
        with pytest.raises(InputError, match=says.format(what, size)) as error:
            make()
        assert "\n" not in str(error.value)
    assert names() == before


@linux
def test_a_servo_on_a_small_dev_shm_is_refused_and_one_that_runs_survives_its_filling(tmp_path):
    """In a mount namespace of its own with a tmpfs of 256 kB as /dev/shm; skipped where that may not be made."""
    probe = ["unshare", "--mount", "sh", "-c", f"mount -t tmpfs -o size={SMALL} tmpfs /dev/shm"]
    try:
        done = subprocess.run(probe, capture_output=True, check=False)
    except OSError as error:
        pytest.skip(f"unshare: {error.strerror}")
    if done.returncode != 0:
        pytest.skip(f"a tmpfs cannot be mounted here ({done.stderr.decode().strip()})")
    code = """
import os
from otwarp.errors import InputError
from otwarp.haptics.core.shared_memory import Mailbox, Ring
from otwarp.haptics.servo.link import HandSetup, SceneLayout
from otwarp.haptics.servo.process import ServoProcess
from otwarp.haptics.core import SceneFrame, SphereFrame
from tests.haptics.spring import SpringChain
hand = HandSetup("virtual:hold", SpringChain)
try:
    ServoProcess([hand], spheres=1, traps=1)
except InputError as error:
    print(error)
print(os.listdir("/dev/shm"))
box, ring = Mailbox.create(SceneLayout(64, 64)), Ring.create(500)
with open("/dev/shm/filler", "wb", buffering=0) as filler:
    try:
        while filler.write(bytes(4096)): pass
    except OSError as error:
        print(error.strerror)
many = tuple(SphereFrame((1.0, 2.0, 3.0), n) for n in range(64))
box.write(SceneFrame(1, 0.0, many, ()))   # died of SIGBUS here
for n in range(500):
    assert ring.push(tuple([n] + [0.0] * 5 + [0] * 4 + [0.0] * 11 + [0] + [0.0] * 3))
print("alive")
"""
    command = ["unshare", "--mount", "sh", "-c", f'mount -t tmpfs -o size={SMALL} tmpfs /dev/shm && exec "$@"', "sh"]
    done = subprocess.run([*command, sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (done.returncode, done.stderr)
    refused, left, full, last = done.stdout.splitlines()
    assert re.match(r"shared memory for a ring of 8000 cycles: /dev/shm needs \d+ bytes, \d+ are free", refused)
    assert (left, full, last) == ("[]", "No space left on device", "alive")
