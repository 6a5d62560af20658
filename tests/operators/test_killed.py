"""A study of simulated operators that is killed at its work goes on to the same bits, by the same line."""

import signal
import subprocess
import sys

import numpy as np

from otwarp.operators.folder import open_folder

KILLED = """
import os, signal
from otwarp.operators import folder

written = folder.written

def killed(file):
    if file.parent.name == "done" and file.name == "000002":
        os.kill(os.getpid(), signal.SIGKILL)
    return written(file)

folder.written = killed
from otwarp.cli.start import start
start()
"""
"""The command, killed when the third chunk is written and not yet marked as whole."""


def command(out):
    asked = ["--operators", "6", "--chunk", "1", "--duration", "2", "--device", "cpu", "--out", str(out)]
    return [sys.executable, "-m", "otwarp", "operators", "run", "scenes/cell_delivery.usda", *asked]


def test_a_killed_study_goes_on(tmp_path):
    subprocess.run(command(tmp_path / "whole"), check=True, capture_output=True)
    killed = tmp_path / "killed"
    line = command(killed)
    ended = subprocess.run([line[0], "-c", KILLED, *line[3:]], capture_output=True, text=True, check=False)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    assert sorted(mark.name for mark in (killed / "done").iterdir()) == ["000000", "000001"]
    again = subprocess.run(command(killed), check=True, capture_output=True, text=True)
    assert "6 simulated operators are done" in again.stdout
    whole = open_folder(tmp_path / "whole").read()
    for name, row in open_folder(killed).read().items():
        np.testing.assert_array_equal(row, whole[name], err_msg=name)
