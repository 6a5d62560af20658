"""Networks as CUDA graphs: with few images at once a GPU would wait for the launches of some hundred kernels."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from otwarp.vision.networks.library import torch_library

WARM_UP = 3
"""Steps before one is captured, in which libraries choose algorithms and take memory; they change nothing."""


def set_rate(optimiser: Any, rate: float) -> None:
    """The learning rate, as a number or where captured steps read it."""
    for group in optimiser.param_groups:
        if isinstance(group["lr"], float):
            group["lr"] = rate
        else:
            group["lr"].fill_(rate)


def warm_up(work: Callable[[], Any], device: Any) -> None:
    """Do what is to be captured `WARM_UP` times, on a stream beside the current one, as capturing asks for.

    Args:
        work: Launches on the current stream of the device alone.
        device: torch's, a GPU.
    """
    torch = torch_library()
    aside = torch.cuda.Stream(device)
    aside.wait_stream(torch.cuda.current_stream(device))
    with torch.cuda.stream(aside):
        for _ in range(WARM_UP):
            work()
    torch.cuda.current_stream(device).wait_stream(aside)


def capture(graph: Any, work: Callable[[], Any], device: Any) -> Any:
    """Record what is launched into a graph; nothing is computed.

    Args:
        graph: Of torch, new.
        work: As of `warm_up`.
        device: torch's, a GPU.

    Returns:
        What `work` returned: tensors that replays fill.
    """
    torch = torch_library()
    # without these a graph records on the GPU that is current, which with several need not be this one, and a call of
    # another thread, Warp's say, would end the capture
    with (
        torch.cuda.device(device),
        torch.cuda.graph(graph, stream=torch.cuda.Stream(device), capture_error_mode="thread_local"),
    ):
        return work()


class CapturedSteps:
    """A step of an optimiser, recorded once for each size of a batch and replayed.

    Args:
        step: `(batch, share) -> loss`, on a GPU alone: indices into the images, share of the density in the loss.
        network, optimiser: That it changes, of torch.
        random: Generator that it draws from, on the GPU, beside the default one.
    """

    def __init__(self, step: Callable[[Any, Any], Any], network: Any, optimiser: Any, random: Any):
        torch = torch_library()
        self.step, self.network, self.optimiser, self.random = step, network, optimiser, random
        self.share = torch.zeros((), device=random.device)
        self.graphs: dict[int, tuple[Any, Any, Any]] = {}
        for group in optimiser.param_groups:
            # a number of the host would be captured with its value
            group["lr"] = torch.tensor(float(group["lr"]), device=random.device)
            group["capturable"] = True

    def __call__(self, batch: Any, share: float) -> Any:
        """Take the step; its loss, on the device, where the next step's overwrites it."""
        if len(batch) not in self.graphs:
            self.graphs[len(batch)] = self._captured(batch.clone())
        graph, index, loss = self.graphs[len(batch)]
        index.copy_(batch)
        self.share.fill_(share)
        graph.replay()
        return loss

    def _captured(self, index: Any) -> tuple[Any, Any, Any]:
        """A graph, the indices that it reads, and the loss that it writes."""
        device = self.random.device
        with self._unchanged():
            warm_up(lambda: self.step(index, self.share), device)
        graph = torch_library().cuda.CUDAGraph()
        # torch puts the numbers that a graph keeps of a generator on the GPU that is current
        with torch_library().cuda.device(device):
            graph.register_generator_state(self.random)
        self.optimiser.zero_grad(set_to_none=True)
        return graph, index, capture(graph, lambda: self.step(index, self.share), device)

    @contextmanager
    def _unchanged(self) -> Iterator[None]:
        """Weights, moments of the optimiser and random numbers as they were, in the memory in which they are."""
        torch = torch_library()
        weights = {name: value.clone() for name, value in self.network.state_dict().items()}
        moments = {p: {k: v.clone() for k, v in kept.items()} for p, kept in self.optimiser.state.items()}
        default, own = torch.cuda.get_rng_state(self.random.device), self.random.get_state()
        yield
        for name, value in self.network.state_dict().items():
            value.copy_(weights[name])
        for parameter, kept in self.optimiser.state.items():
            for name, value in kept.items():
                # before the first step there are none, and they begin with 0
                value.copy_(moments.get(parameter, {}).get(name, torch.zeros_like(value)))
        torch.cuda.set_rng_state(default, self.random.device)
        self.random.set_state(own)


class CapturedNetwork:
    """A network in use on a GPU, recorded once for each small number of images and replayed.

    Args:
        look: What the network says of images, uint8 (n, height, width) on the GPU; launches alone, of weights that
            stay.
    """

    def __init__(self, look: Callable[[Any], dict[str, Any]]):
        self.look = look
        self.graphs: dict[int, tuple[Any, Any, dict[str, Any]]] = {}

    def __call__(self, images: Any) -> dict[str, Any]:
        """What the network says of images; the next call overwrites it."""
        if len(images) not in self.graphs:
            self.graphs[len(images)] = self._captured(images.clone())
        graph, shown, said = self.graphs[len(images)]
        shown.copy_(images)
        graph.replay()
        return said

    def _captured(self, images: Any) -> tuple[Any, Any, dict[str, Any]]:
        """A graph, the images that it reads, and what it writes."""
        warm_up(lambda: self.look(images), images.device)
        graph = torch_library().cuda.CUDAGraph()
        return graph, images, capture(graph, lambda: self.look(images), images.device)
