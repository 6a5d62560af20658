"""Case b in C for one core: Verlet lists with a skin from sorted cells, Hertz repulsion, Euler–Maruyama, Philox noise.

The spheres are those of `benchmarks.crowd`: same places at the start, same force, same time step. They are sorted by
cell whenever lists are made, which is when one of them has moved by half the skin (Verlet 1967,
doi:10.1103/PhysRev.159.98); each pair is listed once. The contact is explicit, as in other codes.
"""

from __future__ import annotations

import ctypes

import numpy as np

from otwarp.bench.speed.many_body import spheres
from otwarp.bench.speed.peers import c_bead

SKIN = 0.5
"""In diameters: lists last for about ten steps, and longer ones are slower."""

MOST = 40
"""Room for listed neighbours per sphere."""

STEPS = r"""
#include <stdlib.h>
typedef struct { float x, y, z; uint32_t id; } Ball;

static int cell_of(float v, float low, float inverse, int cells) {
  int c = (int)((v - low) * inverse);
  return c < 0 ? 0 : c >= cells ? cells - 1 : c;
}

/* sort by cell, then list for every ball those of later places nearer than `reach` */
static int make_lists(Ball *ball, Ball *spare, Ball *built, int n, float reach, int most, int *count, int *list) {
  float low[3] = {1e30f, 1e30f, 1e30f}, high[3] = {-1e30f, -1e30f, -1e30f};
  for (int i = 0; i < n; i++) {
    float v[3] = {ball[i].x, ball[i].y, ball[i].z};
    for (int k = 0; k < 3; k++) {
      low[k] = v[k] < low[k] ? v[k] : low[k];
      high[k] = v[k] > high[k] ? v[k] : high[k];
    }
  }
  int cells[3];
  for (int k = 0; k < 3; k++) cells[k] = 1 + (int)((high[k] - low[k]) / reach);
  int total = cells[0] * cells[1] * cells[2];
  float inverse = 1.0f / reach;
  int *start = calloc(total + 2, sizeof(int)), *where = malloc(n * sizeof(int));
  if (!start || !where) return 1;
  for (int i = 0; i < n; i++) {
    where[i] = (cell_of(ball[i].x, low[0], inverse, cells[0]) * cells[1] +
                cell_of(ball[i].y, low[1], inverse, cells[1])) * cells[2] +
               cell_of(ball[i].z, low[2], inverse, cells[2]);
    start[where[i] + 2]++;
  }
  for (int c = 0; c < total; c++) start[c + 2] += start[c + 1];
  for (int i = 0; i < n; i++) spare[start[where[i] + 1]++] = ball[i];
  memcpy(ball, spare, n * sizeof(Ball));
  memcpy(built, spare, n * sizeof(Ball));
  int bad = 0;
  for (int a = 0; a < cells[0]; a++)
    for (int b = 0; b < cells[1]; b++)
      for (int c = 0; c < cells[2]; c++) {
        int home = (a * cells[1] + b) * cells[2] + c;
        for (int i = start[home]; i < start[home + 1]; i++) {
          int found = 0;
          for (int d = a; d <= a + 1 && d < cells[0]; d++)
            for (int e = b > 0 ? b - 1 : 0; e <= b + 1 && e < cells[1]; e++) {
              int row = (d * cells[1] + e) * cells[2];
              int first = start[row + (c > 0 ? c - 1 : 0)], last = start[row + (c + 1 < cells[2] ? c + 1 : c) + 1];
              for (int j = first > i ? first : i + 1; j < last; j++) {
                float x = ball[i].x - ball[j].x, y = ball[i].y - ball[j].y, z = ball[i].z - ball[j].z;
                if (x * x + y * y + z * z < reach * reach) {
                  if (found < most) list[(size_t)i * most + found] = j;
                  found++;
                }
              }
            }
          bad |= found > most;
          count[i] = found < most ? found : most;
        }
      }
  free(start);
  free(where);
  return bad;
}

/* `steps` steps; returns how often lists were made, -1 if they were too short */
int crowd(Ball *ball, Ball *spare, Ball *built, float *force, int n, float diameter, float hardness, float mobility,
          float kick, float skin, int most, int *count, int *list, int *fresh, uint32_t first, int steps,
          uint32_t seed) {
  int made = 0;
  for (int t = 0; t < steps; t++) {
    if (!*fresh) {
      if (make_lists(ball, spare, built, n, diameter + skin, most, count, list)) return -1;
      *fresh = 1;
      made++;
    }
    memset(force, 0, 12 * (size_t)n);
    for (int i = 0; i < n; i++) {
      float fx = 0.0f, fy = 0.0f, fz = 0.0f;
      for (int m = 0; m < count[i]; m++) {
        int j = list[(size_t)i * most + m];
        float x = ball[i].x - ball[j].x, y = ball[i].y - ball[j].y, z = ball[i].z - ball[j].z;
        float square = x * x + y * y + z * z;
        if (square < diameter * diameter) {
          float distance = sqrtf(square), overlap = diameter - distance;
          float f = hardness * overlap * sqrtf(overlap) / distance;
          fx += f * x;
          fy += f * y;
          fz += f * z;
          force[3 * j] -= f * x;
          force[3 * j + 1] -= f * y;
          force[3 * j + 2] -= f * z;
        }
      }
      force[3 * i] += fx;
      force[3 * i + 1] += fy;
      force[3 * i + 2] += fz;
    }
    float farthest = 0.0f;
    for (int i = 0; i < n; i++) {
      uint32_t w[4];
      philox(first + t, 0, ball[i].id, 0, seed, 0, w);
      float r = kick * sqrtf(minus_two_log(w[0])), q = kick * sqrtf(minus_two_log(w[2])), s, c, u, v;
      sine_cosine(w[1], &s, &c);
      sine_cosine(w[3], &u, &v);
      ball[i].x += mobility * force[3 * i] + r * c;
      ball[i].y += mobility * force[3 * i + 1] + r * s;
      ball[i].z += mobility * force[3 * i + 2] + q * v;
      float x = ball[i].x - built[i].x, y = ball[i].y - built[i].y, z = ball[i].z - built[i].z;
      float moved = x * x + y * y + z * z;
      farthest = moved > farthest ? moved : farthest;
    }
    if (4.0f * farthest > skin * skin) *fresh = 0;
  }
  return made;
}
"""


def missing(kind: str) -> str | None:
    """On a CPU with gcc."""
    return c_bead.missing(kind)


class Peer:
    """`count` spheres of `otwarp.bench.speed.many_body`; `step(steps)`, and `positions()` in the order of the start."""

    name = "C, Verlet lists, gcc -O3 -march=native -ffast-math"

    def __init__(self, count: int, *, seed: int = 7, kind: str = "cpu"):
        what = spheres(count)
        self.call = c_bead.compiled(c_bead.noise() + STEPS).crowd
        self.count, self.seed, self.taken, self.made = count, seed, 0, 0
        layout = [("place", np.float32, 3), ("id", np.uint32)]
        self.balls = np.zeros(count, dtype=layout)
        self.balls["place"], self.balls["id"] = what.start, np.arange(count)
        self.scratch = [np.zeros(count, dtype=layout), np.zeros(count, dtype=layout), np.zeros(3 * count, np.float32)]
        self.near = [np.zeros(count, np.int32), np.zeros(count * MOST, np.int32), np.zeros(1, np.int32)]
        law = (what.diameter, what.hardness, what.mobility, what.kick, SKIN * what.diameter)
        self.constants = [ctypes.c_float(v) for v in law]

    def step(self, steps: int) -> None:
        arrays = [ctypes.c_void_p(a.ctypes.data) for a in (self.balls, *self.scratch)]
        near = [ctypes.c_void_p(a.ctypes.data) for a in self.near]
        first, seed = ctypes.c_uint32(self.taken), ctypes.c_uint32(self.seed)
        made = self.call(*arrays, self.count, *self.constants, MOST, *near, first, steps, seed)
        if made < 0:
            raise RuntimeError(f"more than {MOST} neighbours of one sphere")
        self.made += made
        self.taken += steps

    def positions(self) -> np.ndarray:
        """(count, 3) [µm]."""
        out = np.zeros((self.count, 3), dtype=np.float32)
        out[self.balls["id"]] = self.balls["place"]
        return out
