"""The skip table: for every optional term feature sets with and without it, and the functions that only it needs."""

from __future__ import annotations

import dataclasses

from otwarp.kernels.body_forces.external import EXTERNAL
from otwarp.kernels.core.features import Features

BASE = Features()
"""A lone sphere with noise, and nothing else."""
EVERYTHING = Features(
    driver="world", bodies=2, traps=3, rigid=True, gravity=True, flow="poiseuille", moving_traps=True,
    trap_models=("harmonic_isotropic", "harmonic_split", "piecewise_isotropic", "piecewise_split"), speed_limits=True,
    obstacles=("box", "capsule", "cylinder", "mesh", "plane", "sphere"), moving_obstacles=True, pairs=True,
    escapes=True,
)  # fmt: skip

SOFT_CROWD = dataclasses.replace(BASE, driver="grid", bodies=30, pairs=True, soft_contacts=True)
"""Spheres whose contacts are soft."""

HELD_ROBOT = dataclasses.replace(
    BASE, rigid=True, spheres=False, traps=3, trap_models=("harmonic_isotropic",), escapes=True, integrator="heun"
)
"""A robot that traps can lose."""

CASES: dict[str, tuple[Features, Features, tuple[str, ...]]] = {
    # term: (with it, without it, functions that only it needs)
    "brownian": (BASE, dataclasses.replace(BASE, brownian=False), ("philox", "gaussian_pair", "noise_words")),
    "harmonic": (
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        BASE,
        ("harmonic_isotropic", "harmonic_ratio", "commanded_still"),
    ),
    "piecewise": (
        dataclasses.replace(BASE, traps=1, trap_models=("piecewise_isotropic",)),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        ("piecewise_ratio",),
    ),
    "split": (
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_split",)),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        ("harmonic_split", ").axial_stiffness)"),
    ),
    "moving traps": (
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",), moving_traps=True),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        ("commanded_animated", "find_key", "key_weight"),
    ),
    "gliding traps": (
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",), gliding_traps=True),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        ("glided", ").trap_velocity)"),
    ),
    "speed limits": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, speed_limits=False),
        ("limited_focus",),
    ),
    "rotation": (
        dataclasses.replace(BASE, rigid=True, spheres=False),
        BASE,
        ("rigid_constants", "rotate_by", ").cholesky)"),
    ),
    "lone spheres": (EVERYTHING, dataclasses.replace(EVERYTHING, spheres=False), ("bead_constants", "sphere_response")),
    "uniform flow": (dataclasses.replace(BASE, flow="uniform"), BASE, ("uniform_flow",)),
    "shear flow": (dataclasses.replace(BASE, flow="shear"), dataclasses.replace(BASE, flow="uniform"), ("shear_flow",)),
    "poiseuille": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, flow=None),
        ("poiseuille_flow", "flow_velocity", ").flow_coupling)"),
    ),
    "gravity": (dataclasses.replace(BASE, gravity=True), BASE, (").weight)",)),
    "coupling": (
        dataclasses.replace(EVERYTHING, coupling=True),
        EVERYTHING,
        ("pair_mobility", "factorise_blocks", "carry_others", "carried_by", "fill_root"),
    ),
    "coupling without contact": (
        dataclasses.replace(BASE, driver="world", bodies=2, coupling=True, brownian=False),
        dataclasses.replace(BASE, driver="world", bodies=2, brownian=False),
        ("pair_mobility", "carry_others"),
    ),
    "noise of coupled bodies": (
        dataclasses.replace(BASE, driver="world", bodies=2, coupling=True),
        dataclasses.replace(BASE, driver="world", bodies=2, coupling=True, brownian=False),
        ("factorise_blocks", "fill_root", "philox"),
    ),
    "rotation of coupled bodies": (
        dataclasses.replace(BASE, driver="world", bodies=2, rigid=True, coupling=True),
        dataclasses.replace(BASE, driver="world", bodies=2, coupling=True),
        (").given_turning)", ").turning_root)", ").with_turning)", "mobility_product"),
    ),
    "escapes": (EVERYTHING, dataclasses.replace(EVERYTHING, escapes=False), ("record_escapes", ").held_range)")),
    "obstacles": (
        dataclasses.replace(EVERYTHING, pairs=False),
        dataclasses.replace(EVERYTHING, pairs=False, obstacles=(), moving_obstacles=False),
        ("wall_contacts", "box_distance", "mesh_distance", "hertz_dmt", "solve_contacts", "rigid_response"),
    ),
    "one shape of six": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, obstacles=("box",)),
        ("plane_distance", "ball_distance", "cylinder_distance", "capsule_distance", "mesh_distance"),
    ),
    "moving obstacles": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, moving_traps=False, moving_obstacles=False),
        ("moving_pose", "find_key"),
    ),
    "periodic axes": (dataclasses.replace(EVERYTHING, periodic=True), EVERYTHING, ("image_shift", "kept_in_cell")),
    "periodic grid": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, periodic=True),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        ("image_shift", "kept_in_cell", "nearest"),
    ),
    "periodic beads": (dataclasses.replace(BASE, periodic=True), BASE, ("kept_in_cell", ").period)")),
    "inlet": (
        dataclasses.replace(EVERYTHING, inlet=True),
        EVERYTHING,
        ("let_all_in", "entry_place", "has_left", "clear_of_obstacles"),
    ),
    "inlet of beads": (dataclasses.replace(BASE, inlet=True), BASE, ("kept_in_space", ").inlets)")),
    "inlet of beads, on a CPU": (
        dataclasses.replace(BASE, inlet=True, lanes=True),
        dataclasses.replace(BASE, lanes=True),
        ("kept_in_space",),
    ),
    "inlet of bodies that turn": (
        dataclasses.replace(BASE, rigid=True, spheres=False, inlet=True),
        dataclasses.replace(BASE, rigid=True, spheres=False),
        ("kept_in_space",),
    ),
    "grid inlet": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, inlet=True),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        ("let_in_world", "has_left", ").outside)"),
    ),
    "grid inlet, soft contacts": (
        dataclasses.replace(SOFT_CROWD, inlet=True),
        SOFT_CROWD,
        ("let_slots_in", "has_left", ").outside)"),
    ),
    "pairs": (EVERYTHING, dataclasses.replace(EVERYTHING, pairs=False), ("pair_contacts",)),
    "worlds that end": (
        dataclasses.replace(BASE, episodes=True),
        BASE,
        ("living_world", "own_step", "trial_number"),
    ),
    "worlds that end, in contact": (
        dataclasses.replace(EVERYTHING, episodes=True),
        EVERYTHING,
        ("living_world", "own_step", "trial_number"),
    ),
    "worlds that end, on a CPU": (
        dataclasses.replace(BASE, episodes=True, lanes=True),
        dataclasses.replace(BASE, lanes=True),
        ("living_world", "own_step", "trial_number"),
    ),
    "grid pairs": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, pairs=False),
        ("cell_key", "sphere_contacts"),
    ),
    "grid moving obstacles": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, moving_traps=False, moving_obstacles=False),
        ("moving_pose", "find_key"),
    ),
    "grid rotation": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, rigid=False),
        ("rigid_response", "rigid_constants", "rotate_by"),
    ),
    "hydrodynamic walls": (
        dataclasses.replace(BASE, walls=1),
        BASE,
        ("near_one", "along_and_across", "out_of_walls", "height_above"),
    ),
    "several walls": (
        dataclasses.replace(BASE, walls=2),
        dataclasses.replace(BASE, walls=1),
        ("near_many", "lower_root"),
    ),
    "walls beside bodies that turn": (
        dataclasses.replace(BASE, rigid=True, spheres=False, walls=1),
        dataclasses.replace(BASE, rigid=True, spheres=False),
        ("frictions", "body_root", "out_of_walls"),
    ),
    "rods": (
        dataclasses.replace(EVERYTHING, rods=True),
        EVERYTHING,
        ("segment_slope", "obstacle_slope", "valley_counts", "nearest_t", "crossing_term"),
    ),
    "samples finer than the step": (
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",), moving_traps=True, leaps=True),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",), moving_traps=True),
        ("just_before_end",),
    ),
    "crossings": (EVERYTHING, dataclasses.replace(EVERYTHING, crossings=False), ("crossed", "spread2")),
    "contacts solved for moves": (
        dataclasses.replace(EVERYTHING, body_space=True),
        EVERYTHING,
        ("join_bodies", "solve_bodies"),
    ),
    "contacts solved for forces": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, body_space=True),
        ("press_closed", "path_error", "solve_contacts"),
    ),
    "forces with parameters": (
        dataclasses.replace(BASE, forces=(EXTERNAL,)),
        BASE,
        ("external", "force_input", "only_force", "vector_at"),
    ),
    "rectangular flow": (
        dataclasses.replace(BASE, flow="rectangular"),
        dataclasses.replace(BASE, flow="poiseuille"),
        ("rectangular_flow", "channel_sums", ").drive)"),
    ),
    "flow from a file": (
        dataclasses.replace(BASE, flow="grid"),
        dataclasses.replace(BASE, flow="uniform"),
        ("grid_flow", ").per_spacing)"),
    ),
    "force tables": (
        dataclasses.replace(BASE, traps=1, trap_models=("table_bilinear",)),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        ("bilinear", "outer_level", "table_force", "cell_start"),
    ),
    "bicubic tables": (
        dataclasses.replace(BASE, traps=1, trap_models=("table_bicubic",)),
        dataclasses.replace(BASE, traps=1, trap_models=("table_bilinear",)),
        ("bicubic", "cubic_weights"),
    ),
    "soft contacts": (
        SOFT_CROWD,
        dataclasses.replace(SOFT_CROWD, soft_contacts=False),
        ("soft_pair", "step_slot", "slot_element"),
    ),
    "stiff contacts": (
        dataclasses.replace(SOFT_CROWD, soft_contacts=False),
        SOFT_CROWD,
        ("excursion", "sphere_element", "relax_body", "correct_heun"),
    ),
    "contacts in turn": (
        dataclasses.replace(SOFT_CROWD, soft_contacts=False, in_turn=True),
        dataclasses.replace(SOFT_CROWD, soft_contacts=False),
        ("one_round", "check_rest", "take_turn"),
    ),
    "contacts in sweeps": (
        dataclasses.replace(SOFT_CROWD, soft_contacts=False),
        dataclasses.replace(SOFT_CROWD, soft_contacts=False, in_turn=True),
        ("relax_body", "guess_scale", "row_sum_of"),
    ),
    "worlds by themselves": (
        dataclasses.replace(SOFT_CROWD, soft_contacts=False, by_world=True),
        dataclasses.replace(SOFT_CROWD, soft_contacts=False),
        ("world_of_many", "of_world", "next_of_all"),
    ),
    "neighbours in vectors": (
        dataclasses.replace(SOFT_CROWD, soft_contacts=False, by_world=True, in_turn=True),
        dataclasses.replace(SOFT_CROWD, soft_contacts=False, by_world=True),
        ("among", "of_columns"),
    ),
    "noise in blocks beside bodies that turn": (
        dataclasses.replace(SOFT_CROWD, soft_contacts=False, rigid=True, blocks=True),
        dataclasses.replace(SOFT_CROWD, soft_contacts=False, rigid=True),
        ("body_block", "draw_block"),
    ),
    "launches for all worlds": (
        dataclasses.replace(SOFT_CROWD, soft_contacts=False),
        dataclasses.replace(SOFT_CROWD, soft_contacts=False, by_world=True),
        ("cell_key", ").active)"),
    ),
    "lanes": (dataclasses.replace(BASE, lanes=True), BASE, ("BeadLane", "noise_block", "advance_lane")),
    "vectors": (
        dataclasses.replace(BASE, lanes=True, vectors=True),
        dataclasses.replace(BASE, lanes=True),
        ("step_together", "same_bits", "lay_out"),
    ),
    "listed traps": (
        dataclasses.replace(HELD_ROBOT, listed=True),
        HELD_ROBOT,
        ("list_pairs", "keep_aims", "listed_wrench", "strayed"),
    ),
    "contacts in local arrays": (dataclasses.replace(EVERYTHING, keeps=True), EVERYTHING, ("list_of",)),
    "constants for a launch": (
        dataclasses.replace(EVERYTHING, cached=True),
        EVERYTHING,
        ("keep_constants", "kept_of_any"),
    ),
    "three-point noise": (dataclasses.replace(BASE, noise="threePoint"), BASE, ("three_point", "three_weak")),
    "uniform noise": (dataclasses.replace(BASE, noise="uniform"), BASE, ("uniform_deviate", "three_weak")),
    "Gaussian noise": (BASE, dataclasses.replace(BASE, noise="uniform"), ("gaussian_pair", "squared_radius")),
    "fast math": (dataclasses.replace(BASE, fast_math=True), BASE, ("gaussian_pair_fast",)),
    "second stage": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, integrator="eulerMaruyama"),
        ("correct_heun", "correct_all", "pulled_back"),
    ),
    "exponential integrator": (
        dataclasses.replace(EVERYTHING, integrator="exponential"),
        EVERYTHING,
        ("correct_exponential", "predict_exponential", "harmonic_isotropic_stiffness"),
    ),
    "noise of two steps": (
        dataclasses.replace(EVERYTHING, integrator="leimkuhlerMatthews"),
        EVERYTHING,
        ("predict_leimkuhler_matthews",),
    ),
    "one stage": (
        dataclasses.replace(EVERYTHING, integrator="eulerMaruyama"),
        dataclasses.replace(EVERYTHING, integrator="leimkuhlerMatthews"),
        ("predict_euler_maruyama",),
    ),
}

NUMBERS = {
    "driver": "which of the drivers steps; each has its own kernels",
    "phased": "which form of the world driver steps, by kernels of its own",
    "bodies": "a number",
    "traps": "a number",
    "max_contacts": "a number",
    "looks_once": "where the kernels of phases have what key frames say from",
    "team": "how many threads share out a world, in the kernels of phases",
    "precision": "the type of all numbers",
}
"""Features that switch no term, and what they are instead."""
