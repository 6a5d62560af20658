"""Case a in CUDA C through CuPy: one thread per bead, many steps in registers, Philox4x32-10 and Box–Muller.

Philox: Salmon et al. 2011, doi:10.1145/2063384.2063405. This is what a specialist writes for this one workload.
"""

from __future__ import annotations

import importlib.util

import numpy as np

SOURCE = r"""
extern "C" __global__ void steps(float* place, const float* centre, int beads, float relaxation, float kick,
                                 unsigned first, int count, unsigned seed) {
  int i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= beads) return;
  float x = place[3 * i], y = place[3 * i + 1], z = place[3 * i + 2];
  float cx = centre[0], cy = centre[1], cz = centre[2];
  for (int t = 0; t < count; t++) {
    unsigned a = first + t, b = 0, c = i, d = 0, k = seed, l = 0;
#pragma unroll
    for (int r = 0; r < 10; r++) {
      unsigned e = __umulhi(0xCD9E8D57u, c) ^ b ^ k, f = __umulhi(0xD2511F53u, a) ^ d ^ l;
      b = 0xCD9E8D57u * c;
      d = 0xD2511F53u * a;
      a = e;
      c = f;
      k += 0x9E3779B9u;
      l += 0xBB67AE85u;
    }
    float u = (a >> 8) * 0x1p-24f + 0x1p-25f, v = (c >> 8) * 0x1p-24f + 0x1p-25f;
    float r = kick * sqrtf(-2.0f * LOGF(u)), q = kick * sqrtf(-2.0f * LOGF(v));
    float s, o, p;
    SINCOSF(6.283185307f * (b * 0x1p-32f), &s, &o);
    p = COSF(6.283185307f * (d * 0x1p-32f));
    x += relaxation * (cx - x) + r * o;
    y += relaxation * (cy - y) + r * s;
    z += relaxation * (cz - z) + q * p;
  }
  place[3 * i] = x; place[3 * i + 1] = y; place[3 * i + 2] = z;
}
"""


def missing(kind: str) -> str | None:
    """With CuPy and a GPU."""
    if kind != "cuda":
        return "runs on CUDA alone"
    return None if importlib.util.find_spec("cupy") else "cupy is not installed"


class Peer:
    """See `otwarp.bench.speed.peers`; `fast` takes approximate logarithm, sine and cosine."""

    def __init__(
        self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cuda", fast: bool = False
    ):
        import cupy

        self.cupy, self.beads, self.seed, self.taken = cupy, beads, seed, 0
        self.name = f"CUDA C by CuPy {cupy.__version__}" + (", fast intrinsics" if fast else "")
        text = SOURCE
        for name in ("LOGF", "SINCOSF", "COSF"):
            text = text.replace(name, ("__" if fast else "") + name.lower())
        self.kernel = cupy.RawKernel(text, "steps")
        self.centre = cupy.array([3.0, 5.0, 7.0], dtype=cupy.float32)
        self.position = cupy.tile(self.centre, (beads, 1))
        self.constants = (np.float32(relaxation), np.float32(kick))

    def step(self, steps: int) -> None:
        grid = ((self.beads + 255) // 256,)
        inputs = (self.position, self.centre, np.int32(self.beads), *self.constants)
        self.kernel(grid, (256,), (*inputs, np.uint32(self.taken), np.int32(steps), np.uint32(self.seed)))
        self.cupy.cuda.get_current_stream().synchronize()
        self.taken += steps

    def variance(self) -> float:
        return float(((self.position - self.centre).astype(self.cupy.float64) ** 2).mean())
