"""Case a in C for one core: what its vector units can do, with counter-based noise and many steps fused.

Plain loops over blocks of beads, which gcc turns into vector code. Logarithm, sine and cosine are polynomials fitted
here, at the accuracy of float32. Philox4x32-10: Salmon et al. 2011, doi:10.1145/2063384.2063405; Gaussian deviates: Box
and Muller 1958, doi:10.1214/aoms/1177706645.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-ffast-math", "-fPIC")

NOISE = r"""
#include <math.h>
#include <stdint.h>
#include <string.h>

/* -2 ln u for u = (w + 1/2)/2^32: exponent and mantissa in [1, 2) from the bits, polynomial of the mantissa */
static inline float minus_two_log(uint32_t w) {
  float u = (float)(w >> 8) * 0x1p-24f + 0x1p-25f;
  int32_t bits;
  memcpy(&bits, &u, 4);
  int32_t exponent = (bits >> 23) - 127;
  bits = (bits & 0x007fffff) | 0x3f800000;
  float m;
  memcpy(&m, &bits, 4);
  float t = m - 1.5f;
  return -2.0f * ((float)exponent * 0.693147180559945f + (LOG));
}

/* sine and cosine of 2 pi w/2^32: the turn is split into the nearest quarter and a rest within an eighth */
static inline void sine_cosine(uint32_t w, float *sine, float *cosine) {
  uint32_t quarter = (w + 0x20000000u) >> 30;
  float x = (float)(int32_t)(w - (quarter << 30)) * 0x1p-32f;
  float t = x * x;
  float s = x * (SIN), c = (COS);
  float a = quarter & 1 ? c : s, b = quarter & 1 ? s : c;
  *sine = quarter & 2 ? -a : a;
  *cosine = (quarter + 1) & 2 ? -b : b;
}

/* ten rounds of Philox on the counter (a, b, c, d) with the key (k, l) */
static inline void philox(uint32_t a, uint32_t b, uint32_t c, uint32_t d, uint32_t k, uint32_t l, uint32_t *w) {
#pragma GCC unroll 10
  for (int r = 0; r < 10; r++) {
    uint64_t p = 0xD2511F53ull * a, q = 0xCD9E8D57ull * c;
    uint32_t e = (uint32_t)(q >> 32) ^ b ^ k, f = (uint32_t)(p >> 32) ^ d ^ l;
    b = (uint32_t)q;
    d = (uint32_t)p;
    a = e;
    c = f;
    k += 0x9E3779B9u;
    l += 0xBB67AE85u;
  }
  w[0] = a;
  w[1] = b;
  w[2] = c;
  w[3] = d;
}
"""
"""Words of noise, and what makes Gaussian deviates of them."""

STEPS = r"""
enum { BLOCK = 256 };

void steps(float *restrict x, float *restrict y, float *restrict z, const float *restrict centre, int beads,
           float relaxation, float kick, uint32_t first, int count, uint32_t seed) {
  for (int low = 0; low < beads; low += BLOCK) {
    int n = beads - low < BLOCK ? beads - low : BLOCK;
    uint32_t w0[BLOCK], w1[BLOCK], w2[BLOCK], w3[BLOCK];
    float px[BLOCK], py[BLOCK], pz[BLOCK];
    memcpy(px, x + low, 4 * n);
    memcpy(py, y + low, 4 * n);
    memcpy(pz, z + low, 4 * n);
    for (int t = 0; t < count; t++) {
      for (int i = 0; i < n; i++) {
        uint32_t w[4];
        philox(first + t, 0, low + i, 0, seed, 0, w);
        w0[i] = w[0];
        w1[i] = w[1];
        w2[i] = w[2];
        w3[i] = w[3];
      }
      for (int i = 0; i < n; i++) {
        float r = kick * sqrtf(minus_two_log(w0[i])), q = kick * sqrtf(minus_two_log(w2[i]));
        float s, c, u, v;
        sine_cosine(w1[i], &s, &c);
        sine_cosine(w3[i], &u, &v);
        px[i] += relaxation * (centre[0] - px[i]) + r * c;
        py[i] += relaxation * (centre[1] - py[i]) + r * s;
        pz[i] += relaxation * (centre[2] - pz[i]) + q * v;
      }
    }
    memcpy(x + low, px, 4 * n);
    memcpy(y + low, py, 4 * n);
    memcpy(z + low, pz, 4 * n);
  }
}
"""


def horner(function: Callable[[np.ndarray], np.ndarray], low: float, high: float, degree: int) -> str:
    """A polynomial in `t` that interpolates a function at Chebyshev points, as C text."""
    fit = np.polynomial.Chebyshev.interpolate(function, degree, domain=[low, high])
    factors = fit.convert(kind=np.polynomial.Polynomial).coef
    text = f"{factors[-1]:.9e}f"
    for factor in factors[-2::-1]:
        text = f"({text}) * t + {factor:.9e}f"
    return text


def noise() -> str:
    """C text of the noise: `NOISE` with the coefficients of its polynomials for logarithm, sine and cosine."""

    def sine(t: np.ndarray) -> np.ndarray:
        x = np.sqrt(np.maximum(t, 1e-30))
        return np.sin(2.0 * np.pi * x) / x

    out = NOISE.replace("LOG", horner(lambda t: np.log(1.5 + t), -0.5, 0.5, 9))
    out = out.replace("SIN", horner(sine, 0.0, 1.0 / 64.0, 4))
    return out.replace("COS", horner(lambda t: np.cos(2.0 * np.pi * np.sqrt(np.maximum(t, 0.0))), 0.0, 1.0 / 64.0, 4))


def compiled(text: str) -> ctypes.CDLL:
    """A library of C text, loaded; its file is needed no more.

    Compiled and linked apart: gcc before 13 links start-up code into a `-ffast-math` library that makes the process
    which loads it flush subnormal numbers to zero.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "peer.c"
        file.write_text(text)
        object_file, library = file.with_suffix(".o"), file.with_suffix(".so")
        subprocess.run(["gcc", *FLAGS, "-c", str(file), "-o", str(object_file)], check=True)
        subprocess.run(["gcc", "-shared", str(object_file), "-o", str(library), "-lm"], check=True)
        return ctypes.CDLL(str(library))


def missing(kind: str) -> str | None:
    """On a CPU with gcc."""
    if kind != "cpu":
        return "runs on the CPU alone"
    return None if shutil.which("gcc") else "gcc is not installed"


class Peer:
    """See `otwarp.bench.speed.peers`."""

    name = "C, gcc -O3 -march=native -ffast-math"

    def __init__(self, beads: int, *, relaxation: float, kick: float, seed: int = 7, kind: str = "cpu"):
        self.call = compiled(noise() + STEPS).steps
        self.centre = np.array([3.0, 5.0, 7.0], dtype=np.float32)
        self.position = np.tile(self.centre[:, None], (1, beads))
        self.constants = (ctypes.c_float(relaxation), ctypes.c_float(kick))
        self.seed, self.taken = seed, 0

    def step(self, steps: int) -> None:
        """Take steps."""
        place = [ctypes.c_void_p(row.ctypes.data) for row in self.position]
        centre, beads = ctypes.c_void_p(self.centre.ctypes.data), self.position.shape[1]
        self.call(
            *place, centre, beads, *self.constants, ctypes.c_uint32(self.taken), steps, ctypes.c_uint32(self.seed)
        )
        self.taken += steps

    def variance(self) -> float:
        """Of the distance from the trap along one axis [µm²]."""
        return float(np.mean((self.position.astype(float) - self.centre[:, None]) ** 2))
