"""The compiled loops of `numba_crowd`: imported where numba is installed, and compiled at their first call."""

from __future__ import annotations

import numba  # pyright: ignore[reportMissingImports]
import numpy as np

fast = numba.njit(fastmath=True)
zero = np.float32(0.0)


@fast
def cell_of(place, i, low, inverse, cells):
    a = min(int((place[i, 0] - low[0]) * inverse), cells[0] - 1)
    b = min(int((place[i, 1] - low[1]) * inverse), cells[1] - 1)
    c = min(int((place[i, 2] - low[2]) * inverse), cells[2] - 1)
    return (a * cells[1] + b) * cells[2] + c


@fast
def sort(place, tag, reach, low, cells):
    """Order by cell; returns where each cell begins."""
    balls, inverse = place.shape[0], np.float32(1.0) / reach
    home = np.empty(balls, np.int32)
    start = np.zeros(cells[0] * cells[1] * cells[2] + 2, np.int32)
    for i in range(balls):
        home[i] = cell_of(place, i, low, inverse, cells)
        start[home[i] + 2] += 1
    for c in range(2, len(start)):
        start[c] += start[c - 1]
    old_place, old_tag = place.copy(), tag.copy()
    for i in range(balls):
        k = start[home[i] + 1]
        start[home[i] + 1] = k + 1
        place[k, 0], place[k, 1], place[k, 2] = old_place[i, 0], old_place[i, 1], old_place[i, 2]
        tag[k] = old_tag[i]
    return start


@fast
def make_lists(place, tag, reach, count, near):
    """List every pair nearer than `reach` once, with its earlier sphere; False if there is no room."""
    low, cells = np.empty(3, np.float32), np.empty(3, np.int64)
    for k in range(3):
        low[k] = place[:, k].min()
        cells[k] = 1 + int((place[:, k].max() - low[k]) / reach)
    start = sort(place, tag, reach, low, cells)
    for a in range(cells[0]):
        for b in range(cells[1]):
            for c in range(cells[2]):
                home = (a * cells[1] + b) * cells[2] + c
                for i in range(start[home], start[home + 1]):
                    x, y, z, found = place[i, 0], place[i, 1], place[i, 2], 0
                    for d in range(a, min(a + 2, cells[0])):
                        for e in range(max(b - 1, 0), min(b + 2, cells[1])):
                            row = (d * cells[1] + e) * cells[2]
                            first, last = start[row + max(c - 1, 0)], start[row + min(c + 1, cells[2] - 1) + 1]
                            for j in range(max(first, i + 1), last):
                                u, v, w = x - place[j, 0], y - place[j, 1], z - place[j, 2]
                                if u * u + v * v + w * w < reach * reach:
                                    if found == near.shape[1]:
                                        return False
                                    near[i, found] = j
                                    found += 1
                    count[i] = found
    return True


@fast
def add_forces(place, count, near, force, diameter, hardness):
    force[:] = zero
    for i in range(place.shape[0]):
        x, y, z = place[i, 0], place[i, 1], place[i, 2]
        fx, fy, fz = zero, zero, zero
        for m in range(count[i]):
            j = near[i, m]
            u, v, w = x - place[j, 0], y - place[j, 1], z - place[j, 2]
            square = u * u + v * v + w * w
            if square < diameter * diameter:
                distance = np.sqrt(square)
                overlap = diameter - distance
                f = hardness * overlap * np.sqrt(overlap) / distance
                fx += f * u
                fy += f * v
                fz += f * w
                force[j, 0] -= f * u
                force[j, 1] -= f * v
                force[j, 2] -= f * w
        force[i, 0] += fx
        force[i, 1] += fy
        force[i, 2] += fz


@fast
def move(place, built, force, mobility, kick, rng):
    """One step of all; returns the square of how far the farthest is from where lists were made."""
    farthest = zero
    for i in range(place.shape[0]):
        square = zero
        for k in range(3):
            place[i, k] += mobility * force[i, k] + kick * np.float32(rng.standard_normal())
            gone = place[i, k] - built[i, k]
            square += gone * gone
        farthest = max(farthest, square)
    return farthest


@fast
def run(place, tag, built, force, count, near, diameter, hardness, mobility, kick, skin, fresh, steps, rng):
    """Returns whether lists still hold, and how often they were made, -1 if they had no room."""
    made = 0
    for _ in range(steps):
        if not fresh:
            if not make_lists(place, tag, diameter + skin, count, near):
                return False, -1
            built[:] = place
            made += 1
        add_forces(place, count, near, force, diameter, hardness)
        fresh = np.float32(4.0) * move(place, built, force, mobility, kick, rng) <= skin * skin
    return fresh, made
