"""Worlds with clocks of their own: which of them a thread steps, from which step, and with which noise.

Where all worlds go on for the whole run there is none of this: a thread's place is its world, a launch has one first
step, and a world's noise goes by its index. With episodes (`Features.episodes`) the worlds in motion stand in a list,
so that those which have ended cost nothing, each has a clock, and noise goes by the number of the trial that a world
runs: trial n is the same in whatever world, part or launch it runs, bit for bit. In the grid driver, worlds of which a
block of threads has each to itself have episodes; without them, noise in its parts goes by the index among all worlds.
"""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData


@wp.func
def living_world(model: ModelData, place: int) -> int:
    """The world in a place of the list of those in motion, -1 beyond its end."""
    world = int(-1)
    if place < model.worlds[0].count[0]:
        world = model.worlds[0].living[place]
    return world


@wp.func
def own_step(model: ModelData, world: int, ahead: wp.int64) -> wp.int64:
    """Steps of a world since its start when a segment has gone on by `ahead` steps."""
    return model.worlds[0].step[world] + ahead


@wp.func
def trial_number(model: ModelData, world: int) -> int:
    """Number of the trial that a world runs, the bits of a uint32."""
    return int(model.worlds[0].number[world])


@wp.func
def living_worlds(model: ModelData, first: int, worlds: int) -> int:
    """How many of `worlds` places from `first` on the worlds in motion fill."""
    return wp.min(worlds, model.worlds[0].count[0] - first)


@wp.func
def all_worlds(model: ModelData, first: int, worlds: int) -> int:
    """How many of `worlds` places from `first` on hold worlds in motion: all, where none ends."""
    return worlds


@wp.func
def common_step(model: ModelData, world: int, ahead: wp.int64) -> wp.int64:
    """Number of the step [1], which is the same in all worlds: none has started anew."""
    return ahead


@wp.func
def world_itself(model: ModelData, world: int) -> int:
    """Number of a world's trial [1]: its own index, where no world starts anew."""
    return world


@wp.func
def part_number(model: ModelData, world: int) -> int:
    """Number of a world's trial [1] in the grid driver: its index among the worlds of all parts."""
    return int(model.first_world) + world


def world_term(f: Features) -> wp.Function:
    """`(model, place) -> world` that a place of a launch stands for."""
    return living_world if f.episodes else world_itself


def worlds_term(f: Features) -> wp.Function:
    """`(model, first, worlds) -> int`: how many worlds the places of a launch from `first` on stand for."""
    return living_worlds if f.episodes else all_worlds


def start_term(f: Features) -> wp.Function:
    """`(model, world, first_step) -> step` at which a launch begins in a world."""
    return own_step if f.episodes else common_step


def number_term(f: Features) -> wp.Function:
    """`(model, world) -> int` by which the noise of a world goes."""
    if f.episodes:
        return trial_number
    return part_number if f.driver == "grid" else world_itself


def time_term(f: Features) -> wp.Function:
    """`(model, world, time) -> time` of a world [s], where `time` is that of all worlds without episodes."""

    @wp.func
    def own_time(model: ModelData, world: int, time: wp.float64) -> wp.float64:
        """Time [s] since the world was started or reset."""
        return wp.float64(model.worlds[0].step[world]) * model.time_step

    @wp.func
    def common_time(model: ModelData, world: int, time: wp.float64) -> wp.float64:
        """The time [s] of all worlds."""
        return time

    return own_time if f.episodes else common_time
