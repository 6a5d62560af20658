"""Training of a network in PyTorch by the shortest loop that is fast: images on the device, channels last, bf16."""

from __future__ import annotations

import time
from typing import Any


class BareLoop:
    """Steps by cross entropy of the tilts alone.

    Args:
        network: With `scores` among what it says, on the device of the images; it is trained.
        images: uint8 (n, size, size).
        true_class: int64 (n).
        batch: Images a step.
    """

    def __init__(self, network: Any, images: Any, true_class: Any, *, batch: int):
        import torch

        self.images, self.true_class, self.batch = images, true_class, batch
        self.network = network.to(memory_format=torch.channels_last).train().requires_grad_(True)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=1e-5, fused=True)

    def images_per_second(self, steps: int) -> float:
        """How many images pass the network and back in a second, of the wall clock on a GPU, else of the processor."""
        import torch

        before, torch.backends.cudnn.benchmark = torch.backends.cudnn.benchmark, True
        try:
            self._wait()
            clock = time.perf_counter if self.images.is_cuda else time.process_time
            begun = clock()
            for _ in range(steps):
                self._step()
            self._wait()
            return self.batch * steps / (clock() - begun)
        finally:
            torch.backends.cudnn.benchmark = before

    def _step(self) -> None:
        """One step of the optimiser."""
        import torch

        device = self.images.device
        some = torch.randint(len(self.images), (self.batch,), device=device)
        with torch.autocast(device.type, dtype=torch.bfloat16, enabled=device.type == "cuda"):
            scores = self.network(self.images[some].float() / 255.0)["scores"]
        loss = torch.nn.functional.cross_entropy(scores.float(), self.true_class[some])
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()

    def _wait(self) -> None:
        """Until a GPU has done what it was given."""
        import torch

        if self.images.is_cuda:
            torch.cuda.synchronize(self.images.device)
