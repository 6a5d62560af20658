"""Case a in PyTorch: whole arrays at a time; on CUDA the steps are captured in a graph, as one should."""

from __future__ import annotations

import importlib.util

CAPTURED = 20
"""Steps in one CUDA graph."""


def missing(kind: str) -> str | None:
    """With torch, on CUDA with a build for it."""
    if not importlib.util.find_spec("torch"):
        return "torch is not installed"
    import torch

    return None if kind == "cpu" or torch.cuda.is_available() else "this torch has no CUDA"


class Peer:
    """See `otwarp.bench.speed.peers`."""

    def __init__(self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cpu"):
        import torch

        self.torch, self.kind = torch, kind
        self.name = f"torch {torch.__version__}" + (", CUDA graph" if kind == "cuda" else "")
        if kind == "cpu":
            torch.set_num_threads(1)
        torch.manual_seed(seed)
        self.centre = torch.tensor([3.0, 5.0, 7.0], device=kind)
        self.position = self.centre.repeat(beads, 1)
        self.noise = torch.empty_like(self.position)
        self.relaxation, self.kick = relaxation, kick
        self.graph = self._capture() if kind == "cuda" else None

    def _one(self) -> None:
        self.noise.normal_()
        self.position.add_(self.centre - self.position, alpha=self.relaxation).add_(self.noise, alpha=self.kick)

    def _capture(self):
        torch = self.torch
        stream = torch.cuda.Stream()
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            for _ in range(3):
                self._one()
        torch.cuda.current_stream().wait_stream(stream)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            for _ in range(CAPTURED):
                self._one()
        return graph

    def step(self, steps: int) -> None:
        with self.torch.no_grad():
            whole = steps // CAPTURED if self.graph is not None else 0
            for _ in range(whole):
                self.graph.replay()
            for _ in range(steps - whole * CAPTURED):
                self._one()
        if self.kind == "cuda":
            self.torch.cuda.synchronize()

    def variance(self) -> float:
        return float(((self.position - self.centre).double() ** 2).mean())
