"""Neighbour lists: the pairs that all against all gives, and new lists only when something has moved far enough."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.kernels.cpu.pair_block import PAIRS
from otwarp.kernels.drivers.grid.neighbours import FULL, NEIGHBOURS
from otwarp.scene import Scene
from otwarp.simulation.drivers.block_stepper import BlockStepper
from otwarp.simulation.drivers.grid_phases_stepper import GridPhasesStepper
from otwarp.simulation.drivers.grid_scratch import choose_cells
from otwarp.simulation.drivers.grid_stepper import GridStepper
from otwarp.simulation.simulation import Simulation
from tests.simulation.crowds import crowd, jumbled, places
from tests.simulation.setups import robot

ROUNDING = 1e-4
"""Of distances between coordinates of some 100 µm in float32 [µm]: pairs so near the limit may or may not be listed."""

CROWDS = {
    "near": jumbled(120),
    "beyond zero": jumbled(120) + np.array([-300.0, 0.0, 500.0]),
    "sheet": np.stack([*np.divmod(np.random.default_rng(7).permutation(120), 10), np.zeros(120)], axis=1) * 1.9,
    "two clusters that share cells": np.concatenate([jumbled(60), jumbled(60, seed=1) + np.array([400.0, 0, 0])]),
}


def grid_stepper(sim: Simulation) -> GridStepper | BlockStepper | GridPhasesStepper:
    """Its stepper, of the grid driver."""
    assert isinstance(sim._stepper, GridStepper | BlockStepper | GridPhasesStepper)
    return sim._stepper


def listed(sim: Simulation) -> list[dict[int, list[int]]]:
    """Per world the neighbours of every sphere (numbered as in the scene), in the order of its list; -1: full.

    Slots on a CPU list each pair once and in no order; here both have it, ascending.
    """
    near = grid_stepper(sim).scratch.near
    count, neighbour = near.count.numpy(), near.neighbour.numpy()
    elements, worlds = near.elements, sim.model.worlds
    names = np.tile(np.arange(elements), (worlds, 1))
    if sim.model.features.soft_contacts:
        grid = grid_stepper(sim).scratch
        names = grid.order.numpy()[grid.turn.numpy()[0]].reshape(worlds, elements)
    out = []
    for w in range(worlds):
        lists: dict[int, list[int]] = {int(name): [] for name in names[w]}
        for e in range(elements):
            i, own = w * elements + e, int(names[w, e])
            found = range(max(count[i], 0))
            if len(near.begin):
                for k in found:
                    other = int(names[w, neighbour[near.begin.numpy()[i] + k] // PAIRS - w * elements])
                    lists[own].append(other)
                    lists[other].append(own)
            else:
                entries = [neighbour[i * near.stride + k * near.pitch] - w * elements for k in found]
                lists[own] = [int(names[w, j]) for j in entries]
        if len(near.begin):
            lists = {own: sorted(entries) for own, entries in lists.items()}
        lists |= {int(names[w, e]): [FULL] for e in range(elements) if count[w * elements + e] == FULL}
        out.append(lists)
    return out


def check_lists(sim: Simulation, centres: np.ndarray, radii: np.ndarray, body: np.ndarray) -> None:
    """Lists against all pairs of spheres of other bodies; centres (W, C, 3)."""
    near = grid_stepper(sim).scratch.near
    for world, lists in enumerate(listed(sim)):
        gap = np.linalg.norm(centres[world][:, None] - centres[world][None], axis=2) - radii[:, None] - radii[None]
        other = body[:, None] != body[None]
        wanted = other & (gap < near.reach + near.skin - ROUNDING)
        allowed = other & (gap < near.reach + near.skin + ROUNDING)
        for e, entries in lists.items():
            assert entries == sorted(set(entries))
            assert set(np.flatnonzero(wanted[e])) <= set(entries) <= set(np.flatnonzero(allowed[e]))


@pytest.fixture(params=["soft", "swept", "by world"])
def soft(request, monkeypatch) -> bool:
    """Slots that are sorted, and spheres that stay where they are: sorted by cells, or all pairs of a world."""
    if request.param != "soft":
        monkeypatch.setattr("otwarp.simulation.time_step.softness.EXPLICIT_PRODUCT", 0.0)
    if request.param == "swept":
        monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    return request.param == "soft"


@pytest.mark.parametrize("name", CROWDS)
def test_lists_hold_what_is_near(name, soft, device):
    """Each world has its own; they were made from the start, which one cold step does not change."""
    rng = np.random.default_rng(3)
    radii = rng.uniform(0.6, 1.0, len(CROWDS[name]))
    sim = Simulation(crowd(CROWDS[name], radii, time_step=3e-4), worlds=2, device=device)
    assert sim.model.features.soft_contacts == soft
    moved = places(sim) + rng.uniform(-0.05, 0.05, (2, len(radii), 3))
    sim.set_state(position=moved)
    sim.step()
    check_lists(sim, moved, radii, np.arange(len(radii)))


def test_spheres_of_one_body_are_no_neighbours(device):
    """Rigid bodies: lists are of spheres."""
    rng = np.random.default_rng(5)
    turns = rng.normal(size=(30, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    where = jumbled(30, 5.9, jitter=0.0)
    bodies = tuple(
        robot(f"R{i}", tuple(p), tuple(q), collides=True) for i, (p, q) in enumerate(zip(where, turns, strict=True))
    )
    base = crowd(where)
    sim = Simulation(dataclasses.replace(base, bodies=bodies), device=device)
    assert sim.model.features.rigid
    pose, orientation = places(sim)[0], sim.state.orientation.numpy()[0].astype(float)
    sim.step()
    from otwarp.simulation.packing.traps import rotate

    spheres = sim.model.data.contact.sphere.numpy().astype(float)
    body = sim.model.data.contact.body.numpy()
    centres = pose[body] + rotate(orientation[body], spheres[:, :3])
    check_lists(sim, centres[None], spheres[:, 3], body)
    assert sum(map(len, listed(sim)[0].values())) > 0


def test_a_sphere_with_too_many_neighbours_looks_through_the_cells(soft, device):
    """A large sphere amid small ones: its own list cannot hold them, theirs hold it; forces are those of all pairs."""
    rng = np.random.default_rng(2)
    # evenly over the large sphere, on a spiral
    height = 1.0 - (2.0 * np.arange(60) + 1.0) / 60.0
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(60)
    ring = np.sqrt(1.0 - height**2)
    ways = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    # overlaps of up to 0.05 µm, fewer than a body's contacts: the others stand off by 0.1 µm
    overlap = np.where(np.arange(60) % 4 == 0, rng.uniform(0.01, 0.05, 60), -0.1)
    where = np.concatenate([np.zeros((1, 3)), ways * (4.0 + 0.3 - overlap)[:, None]])
    radii = np.array([4.0] + [0.3] * 60)
    sim = Simulation(crowd(where, radii, time_step=1e-5), device=device)
    assert sim.model.features.soft_contacts == soft
    sim.step()
    lists = listed(sim)[0]
    assert lists[0] == [FULL]
    assert NEIGHBOURS < 60
    assert all(0 in lists[e] for e in range(1, 61))
    load = sim.readout.contact_load.numpy()[0]
    np.testing.assert_array_equal(load[1:] > 0.0, overlap > 0.0)
    assert load[0] == pytest.approx(load[1:].sum(), rel=1e-5)
    net = sim.readout.contact_force.numpy()[0].astype(float)
    np.testing.assert_allclose(net.sum(axis=0), 0.0, atol=1e-5 * np.abs(net).max())
    assert np.abs(net[0]).max() > 0.0


def builds(sim: Simulation) -> int:
    """How often lists were made."""
    return int(grid_stepper(sim).scratch.near.builds.numpy()[0])


def test_new_lists_only_when_something_has_moved_half_the_skin(soft, device):
    """By its own motion, and by a hand that writes to the state."""
    apart = jumbled(30, 4.0, jitter=0.0)
    sim = Simulation(crowd(apart), device=device)
    skin = grid_stepper(sim).scratch.near.skin
    sim.step(200)
    assert builds(sim) == 1
    for share, more in ((0.45, 0), (0.6, 1)):
        moved = apart.copy()
        moved[7, 1] += share * skin
        before = builds(sim)
        sim.state.position.assign(moved[None].astype(np.float32))
        sim.step(3)
        assert builds(sim) == before + more


def test_hot_spheres_make_lists_now_and_then(soft, device):
    """Ten or so steps apart, as the skin is chosen; and never too late, or the lists would miss a pair."""
    scene: Scene = crowd(jumbled(200, 2.5), temperature=298.15)
    sim = Simulation(scene, device=device)
    first = builds(sim)
    sim.step(100)
    assert 3 <= builds(sim) - first <= 30
    for _ in range(40):
        sim.step()
        centres = places(sim)[0]
        gap = np.linalg.norm(centres[:, None] - centres[None], axis=2) - 2.0
        np.fill_diagonal(gap, 1.0)
        lists = listed(sim)[0]
        # what touches now is on the lists of the step that led here, which watched how far all had gone
        assert all(j in lists[i] for i, j in np.argwhere(gap < 0.0))


@pytest.mark.parametrize(
    ("extent", "edge", "elements", "worlds", "cells"),
    [
        ((100.0, 100.0, 100.0), 3.0, 30_000, 1, (32, 32, 64)),
        ((1000.0, 1000.0, 0.0), 3.0, 10_000, 1, (64, 128, 4)),
        ((0.0, 0.0, 0.0), 3.0, 30, 1, (4, 4, 4)),
        ((1e9, 1.0, 1.0), 1.0, 100, 1, (16, 4, 4)),
        ((1e3, 1e3, 1e3), 1.0, 10_000_000, 100_000, (16, 16, 32)),
    ],
)
def test_cells_are_as_many_as_there_is_use_and_room_for(extent, edge, elements, worlds, cells):
    found = choose_cells(np.array(extent), edge, elements, worlds)
    assert found == cells
    assert all(n >= 4 and n & (n - 1) == 0 for n in found)
    assert np.prod(found) <= max(64, 4 * elements)
