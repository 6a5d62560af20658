"""A study of simulated operators that is killed at its work goes on to the same bits, by the same line."""

import subprocess
import sys
import time

import numpy as np

from otwarp.operators.folder import open_folder


def command(out):
    asked = ["--operators", "6", "--chunk", "1", "--duration", "2", "--device", "cpu", "--out", str(out)]
    return [sys.executable, "-m", "otwarp", "operators", "run", "scenes/cell_delivery.usda", *asked]


def test_a_killed_study_goes_on(tmp_path):
    subprocess.run(command(tmp_path / "whole"), check=True, capture_output=True)
    killed = tmp_path / "killed"
    with subprocess.Popen(command(killed), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as child:
        while not (killed / "done" / "000001").exists():
            assert child.poll() is None
            time.sleep(0.005)
        child.kill()
    assert not (killed / "done" / "000005").exists()
    again = subprocess.run(command(killed), check=True, capture_output=True, text=True)
    assert "6 simulated operators are done" in again.stdout
    whole = open_folder(tmp_path / "whole").read()
    for name, row in open_folder(killed).read().items():
        np.testing.assert_array_equal(row, whole[name], err_msg=name)
