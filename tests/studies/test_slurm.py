"""The scripts for Slurm in docs/cluster.md, run as they stand on this host, as if they were its tasks."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from otwarp.studies.store import open_store

pytest.importorskip("zarr")

PAGE = Path(__file__).parents[2] / "docs" / "cluster.md"
SBATCH = {
    *("job-name", "array", "nodes", "ntasks-per-node", "gpus", "gpus-per-node", "cpus-per-task"),
    *("time", "requeue", "output", "open-mode"),
}
"""Options of sbatch that the page uses, from its manual."""


def scripts() -> list[str]:
    """The scripts of the page: the array, and Ray."""
    return [part.split("```")[0] for part in PAGE.read_text(encoding="utf-8").split("```bash\n")[1:]]


def batch(folder: Path, script: str, out: Path, **variables: str) -> subprocess.Popen:
    """A script of the page as Slurm would start it, with another study and folder."""
    text = script.replace("studies/capture.toml", str(folder / "s.toml")).replace("out/capture", f"{out} --device cpu")
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    cache = os.environ.get("WARP_CACHE_PATH", "")
    environment = os.environ | {"PATH": path} | {f"SLURM_{name}": value for name, value in variables.items()}
    text = text.replace("export WARP_CACHE_PATH=", f"export WARP_CACHE_PATH={cache} #" if cache else "#")
    return subprocess.Popen(["bash", "-c", text], cwd=folder, env=environment)


@pytest.mark.quick
def test_scripts_of_the_page():
    """Bash reads them, and sbatch knows their options."""
    assert len(scripts()) == 2
    for script in scripts():
        assert script.startswith("#!/bin/bash\n")
        subprocess.run(["bash", "-n"], input=script, text=True, check=True)
        options = [line.split("--")[1].split("=")[0] for line in script.splitlines() if line.startswith("#SBATCH")]
        assert len(options) > 5 and SBATCH.issuperset(options)


def test_the_array_as_slurm_starts_it(folder, whole, tmp_path):
    """Two tasks side by side."""
    out = tmp_path / "out"
    of = {"ARRAY_TASK_COUNT": "2", "JOB_ID": "7"}
    tasks = [batch(folder, scripts()[0], out, ARRAY_TASK_ID=str(n), **of) for n in (1, 2)]
    assert [task.wait() for task in tasks] == [0, 0]
    assert open_store(out).read().load().identical(whole)


def test_ray_as_slurm_starts_it(folder, whole, tmp_path):
    """One host of the script's: its head, a driver, and nothing that stays."""
    pytest.importorskip("ray")
    out = tmp_path / "out"
    job = {"JOB_ID": str(os.getpid()), "CPUS_PER_TASK": "2", "JOB_NUM_NODES": "1"}
    assert batch(folder, scripts()[1], out, **job).wait() == 0
    assert open_store(out).read().load().identical(whole)
