"""What a feature set says of itself."""

from dataclasses import replace

import pytest

from otwarp.kernels.core.features import WORLD_BLOCK, WORLD_LANES, Features, world_lanes
from otwarp.kernels.terms import terms

BARE = Features(brownian=False, spheres=False)

SWITCHED = {
    "harmonic trap": {"trap_models": ("harmonic_split",)},
    "piecewise trap": {"trap_models": ("piecewise_isotropic",)},
    "tabulated trap": {"trap_models": ("table_bilinear_upright",)},
    "exact optical force": {"trap_models": ("exact_32_512_bilinear_1",)},
    "moving traps": {"moving_traps": True},
    "trap speed limit": {"speed_limits": True},
    "rotation, 6×6 mobility": {"rigid": True},
    "lone-sphere mobility": {"spheres": True},
    "Brownian noise": {"brownian": True},
    "gravity": {"gravity": True},
    "flow": {"flow": "shear"},
    "hydrodynamic walls": {"walls": 1},
    "hydrodynamic coupling": {"coupling": True},
    "moving obstacles": {"moving_obstacles": True},
    "rods in contact": {"rods": True},
    "contacts solved for moves": {"body_space": True},
    "escape detection": {"escapes": True},
    "worlds that end": {"episodes": True},
}


def compiled(features: Features) -> set[str]:
    return {name for name, on, _ in terms(features) if on}


def test_a_bare_scene_has_no_term():
    assert compiled(BARE) == set()
    assert all(why for _, _, why in terms(BARE))


@pytest.mark.parametrize("term", SWITCHED)
def test_each_term_is_switched_by_its_own_feature(term):
    assert compiled(replace(BARE, **SWITCHED[term])) == {term}


def test_contact_brings_implicit_forces_unless_it_is_soft():
    touching = replace(BARE, obstacles=("plane",))
    assert compiled(touching) == {"obstacle contact", "implicit contact forces"}
    assert compiled(replace(touching, soft_contacts=True)) == {"obstacle contact"}
    assert compiled(replace(BARE, pairs=True, driver="grid")) >= {"body–body contact", "neighbour lists"}
    assert touching.contacts and not BARE.contacts


def test_traps_are_still_unless_they_move_by_themselves():
    assert BARE.still_traps
    assert not replace(BARE, moving_traps=True).still_traps and not replace(BARE, speed_limits=True).still_traps


def test_lanes_fill_each_multiprocessor_once():
    """Few worlds have a block each; as many as fit go together in one wave; a block has whole worlds."""
    found = {worlds: world_lanes(worlds, 132) for worlds in (1, 132, 133, 264, 265, 528, 529, 1056, 1057, 10**6)}
    assert found[1] == found[132] == WORLD_BLOCK
    assert found[133] == found[264] == 256 and found[265] == found[528] == 128
    assert found[529] == found[1056] == found[1057] == found[10**6] == WORLD_LANES
    assert all(WORLD_BLOCK % lanes == 0 and WORLD_BLOCK // lanes < 16 for lanes in found.values())
