"""What a change has done to the speed of each scene of `otwarp bench terms`: an older commit beside this tree.

    python -m benchmarks.since 9a89201                      # all scenes that both know
    python -m benchmarks.since 9a89201 --rounds 40 held table
    python -m benchmarks.since before/ --device cuda:0      # a folder with the older tree, where there is no repository

Each tree steps in a process of its own with its own kernels. They take turns, and the least of all turns counts: on a
shared machine the speed changes by a third within a minute, and only a scene's best is a property of the code.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
BODIES = {"cpu": 4096, "cuda": 1 << 18}


class Tree:
    """A process that times scenes with the otwarp of one tree."""

    def __init__(self, tree: Path, cache: Path, device: str):
        packages = os.pathsep.join(filter(None, (str(tree), os.environ.get("PYTHONPATH"))))
        env = os.environ | {"PYTHONPATH": packages, "WARP_CACHE_PATH": str(cache), "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve()), "--serve", device],
            cwd=tree, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.scenes: list[str] = self._answer()

    def _answer(self) -> Any:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"the process of {self.process.args} ended")
        return json.loads(line)

    def sample(self, scene: str) -> float:
        """One measurement [ns per body-step]; inf where the scene cannot be stepped."""
        assert self.process.stdin is not None
        self.process.stdin.write(scene + "\n")
        self.process.stdin.flush()
        taken = self._answer()
        return float("inf") if taken is None else taken


def serve(name: str) -> None:
    """Time the scenes whose names are read, with whatever otwarp is found; runs with trees that differ in layout."""
    import importlib

    import warp as wp

    from otwarp.device import start_warp

    def of(new: str, old: str, what: str) -> Any:
        try:
            return getattr(importlib.import_module(new), what)
        except ImportError:
            return getattr(importlib.import_module(old), {"TimedScene": "Bench"}.get(what, what))

    timed = of("otwarp.bench.terms.measure", "benchmarks.terms", "TimedScene")
    scenes = of("otwarp.bench.terms.scenes", "benchmarks.term_scenes", "SCENES")
    start_warp()
    device = wp.get_device(name)
    bodies = BODIES["cuda" if device.is_cuda else "cpu"]
    made: dict[str, Any] = {}
    print(json.dumps(sorted(scenes)), flush=True)
    for line in sys.stdin:
        scene = line.strip()
        try:
            if scene not in made:
                made[scene] = timed.of(scenes[scene](), device, bodies=bodies, seconds=0.06)
            print(json.dumps(made[scene].sample()), flush=True)
        except Exception as error:  # what a tree refuses is told, and no reason to leave the others out
            print(f"{scene}: {error!r}"[:200], file=sys.stderr)
            print("null", flush=True)


def unpack(commit: str, folder: Path) -> Path:
    """The tree of a commit; a folder is one already."""
    if Path(commit).is_dir():
        return Path(commit).resolve()
    packed = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
    return folder


def compare(
    commit: str, *, rounds: int, device: str, only: list[str], kernels: Path | None = None
) -> dict[str, tuple[float, float]]:
    """Least time of each scene [ns per body-step], of a commit and of this tree."""
    with tempfile.TemporaryDirectory() as folder:
        old, cache = unpack(commit, Path(folder, "tree")), kernels or Path(folder)
        trees = Tree(old, cache / "old", device), Tree(ROOT, cache / "new", device)
        names = [n for n in trees[0].scenes if n in trees[1].scenes and (not only or n in only)]
        best = {n: [float("inf"), float("inf")] for n in names}
        for turn in range(rounds):
            for n in names:
                for side in (0, 1) if turn % 2 == 0 else (1, 0):
                    best[n][side] = min(best[n][side], trees[side].sample(n))
        for tree in trees:
            tree.process.kill()
            tree.process.wait()
    return {n: (first, second) for n, (first, second) in best.items()}


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        # the script's own folder comes first otherwise, and with it this tree's benchmarks
        sys.path[0] = str(Path.cwd())
        serve(sys.argv[2])
    else:
        asked = argparse.ArgumentParser(description="Scenes of `otwarp bench terms`: a commit beside this tree.")
        asked.add_argument("commit")
        asked.add_argument("scenes", nargs="*", help="default: all that both trees have")
        asked.add_argument("--rounds", type=int, default=25)
        asked.add_argument("--device", default="cpu")
        asked.add_argument(
            "--kernels", type=Path, help="keeps the compiled kernels of both trees, and finds them again"
        )
        given = asked.parse_intermixed_args()
        found = compare(
            given.commit, rounds=given.rounds, device=given.device, only=given.scenes, kernels=given.kernels
        )
        print("| scene | before [ns] | now [ns] | times as fast |\n|---|---:|---:|---:|")
        for scene, (before, now) in sorted(found.items(), key=lambda row: row[1][0] / row[1][1]):
            print(f"| {scene} | {before:.4g} | {now:.4g} | {before / now:.3f} |")
