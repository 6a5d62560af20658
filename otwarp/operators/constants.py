"""What chains of many hands are made of, as arrays: configurations, force laws, and which hand has which trap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import within
from otwarp.haptics.chain.paper_mode import curve_law
from otwarp.haptics.core import DeviceInfo
from otwarp.haptics.core.config import RELEASE_ALPHA, RELEASE_RATE, HandConfig, LowPass, PassivityConfig
from otwarp.haptics.force.compiled import PackedLaws, model_of, packed_laws
from otwarp.haptics.force.law import Law
from otwarp.kernels.core.precision import kernel_module
from otwarp.laws import local_rows
from otwarp.operators.kernels import chain_data as twin
from otwarp.operators.kernels.local_model import Felt, ForceTableData
from otwarp.teleop.operators import HandPlan, LocalScene


@dataclass(frozen=True, eq=False)
class FeltScene:
    """What H hands of a world feel: of T traps at most each, on S spheres of K kinds.

    Attributes:
        models: Names of all laws, sorted; a law's number is its index here.
        laws: As the kernels read them.
        law: (H, T, K) row of each trap's law for each kind.
        trap: (H, T) traps of each hand in the scene, ascending; −1 where it has fewer.
        owner: Hand of every trap of the scene, −1 for none.
        kinds, bodies: (S) of each slot of spheres.
        curves: (H, K) law of each hand's first trap.
    """

    models: tuple[str, ...]
    laws: PackedLaws
    law: np.ndarray
    trap: np.ndarray
    owner: np.ndarray
    kinds: np.ndarray
    bodies: np.ndarray
    curves: tuple[tuple[Law, ...], ...]


def limited_configs(
    plans: Sequence[HandPlan], infos: Sequence[DeviceInfo | None] | None
) -> tuple[HandConfig, ...]:  # fmt: skip
    """Configurations of hands, within what their devices can do.

    Raises:
        InputError: No hand, hands of different rates, or another number of devices.
    """
    if not plans:
        raise InputError("plans is empty; allowed: one hand or more")
    rates = {plan.config.chain.rate for plan in plans}
    if len(rates) > 1:
        raise InputError(f"chain.rate of the hands is {', '.join(f'{r:g}' for r in sorted(rates))} Hz; allowed: one")
    if infos is None:
        infos = [None] * len(plans)
    if len(infos) != len(plans):
        raise InputError(f"infos has {len(infos)} devices; allowed: {len(plans)}, one for each hand")
    return tuple(
        plan.config if info is None else replace(plan.config, safety=within(plan.config.safety, info))
        for plan, info in zip(plans, infos, strict=True)
    )


def felt_by(configs: Sequence[HandConfig], local: LocalScene, traps: int | None) -> FeltScene:
    """What hands feel of a scene.

    Args:
        configs: Of the hands.
        local: Laws and slots.
        traps: Of the scene; None for as many as the hands' indices need.

    Raises:
        InputError: A hand without a trap, a trap that is not there or has no law, a law that no hand can feel,
            paper mode with a table.
    """
    for config in configs:
        for trap in config.traps:
            if trap not in local.laws:
                raise InputError(f"hand.traps has {trap}, which has no force law; allowed: {sorted(local.laws)}")
        if not config.traps:
            raise InputError(f"hand {config.name!r} has no traps; allowed: one or more")
    held = [trap for config in configs for trap in config.traps]
    if len(set(held)) < len(held):
        raise InputError(f"hands have the traps {held}; allowed: each trap in one hand")
    count = max(held) + 1 if traps is None else traps
    if count <= max(held):
        raise InputError(f"traps is {count}; allowed: {max(held) + 1} or more, for hands have trap {max(held)}")
    kinds = np.array(local.kinds, dtype=np.int32)
    assert np.all(np.diff(kinds) >= 0), "slots of one kind lie together"
    of_kind = int(kinds.max()) + 1
    laws = [local.laws[trap][kind] for trap in held for kind in range(of_kind)]
    for law in laws:
        if model_of(law) is None:
            raise InputError(f"force law is {type(law).__name__}; allowed: curves of eq. 1, and tables")
    models = tuple(sorted({model_of(law) or "" for law in laws}))
    packed = packed_laws(models, tuple(laws))
    widest = max(len(config.traps) for config in configs)
    trap = np.full((len(configs), widest), -1, dtype=np.int32)
    law = np.zeros((len(configs), widest, of_kind), dtype=np.int32)
    owner = np.full(count, -1, dtype=np.int32)
    for h, config in enumerate(configs):
        mine = sorted(config.traps)
        trap[h, : len(mine)], owner[mine] = mine, h
        for t, index in enumerate(mine):
            law[h, t] = [packed.row[local.laws[index][kind]] for kind in range(of_kind)]
    curves = tuple(local.laws[config.traps[0]][:of_kind] for config in configs)
    for config, choices in zip(configs, curves, strict=True):
        if config.chain.mode == "paper" and None in map(curve_law, choices):
            allowed = "a first trap with a force curve"
            raise InputError(f"chain.mode is 'paper' with traps {config.traps}; allowed: {allowed}")
    return FeltScene(models, packed, law, trap, owner, kinds, np.array(local.bodies, dtype=np.int32), curves)


def put_constants(data: Any, configs: Sequence[HandConfig], scene: FeltScene, device: wp.Device) -> None:
    """Fill the constants of `kernels.chain_data.ChainData`, one row per hand, and what hands feel."""
    data.constants = _rows(twin.ChainConstants, [_of_chain(config) for config in configs], device)
    data.motion_constants = _rows(twin.MotionConstants, [_of_motion(config) for config in configs], device)
    data.passivity_constants = _rows(twin.PassivityConstants, [_of_passivity(config) for config in configs], device)
    data.safety_constants = _rows(twin.SafetyConstants, [_of_safety(config) for config in configs], device)
    data.paper_constants = _rows(twin.PaperConstants, [_of_paper(config) for config in configs], device)
    curves = [[_of_curve(law) for law in choices] for choices in scene.curves]
    data.paper_curve = _rows(twin.PaperCurve, [row for rows in curves for row in rows], device, len(configs))
    data.kind = wp.array(scene.kinds, dtype=wp.int32, device=device)
    data.felt = _felt(configs, scene, device)


def _rows(kind: Any, rows: Sequence[dict[str, Any]], device: wp.Device, first: int = 0) -> wp.array:
    """Structs of a kind from their fields by name; in a table of `first` rows, if that is not 0."""
    packed = np.zeros(len(rows), dtype=kind.numpy_dtype())
    for n, row in enumerate(rows):
        for name, value in row.items():
            packed[n][name] = value
    return wp.array(packed.reshape(first, -1) if first else packed, dtype=kind, device=device)


def _of_chain(config: HandConfig) -> dict[str, Any]:
    chain = config.chain
    return {
        "period": 1.0 / chain.rate,
        "quantum": chain.quantum,
        "damping": chain.damping,
        "back": np.array(config.axis_map).T,
        "alpha": chain.force_filter.at(chain.rate).alpha if chain.force_filter else 1.0,
        "disarm_after": config.safety.disarm_after,
    }


def _of_motion(config: HandConfig) -> dict[str, Any]:
    chain, coupling = config.chain, config.chain.coupling
    return {
        "carry": config.motion_gain * np.array(config.axis_map),
        "longest": chain.trap_speed / chain.rate,
        "alpha": chain.motion_filter.at(chain.rate).alpha if chain.motion_filter else 1.0,
        "coupling_stiffness": coupling.stiffness if coupling else 0.0,
        "coupling_damping": coupling.damping * chain.rate if coupling else 0.0,
    }


def _of_passivity(config: HandConfig) -> dict[str, Any]:
    passivity, quantum = config.chain.passivity or PassivityConfig(), config.chain.quantum
    names = ("reserve", "capacity", "share", "damping_limit", "speed", "acceleration", "hold", "noise")
    own = {"period": 1.0 / config.chain.rate, "quantum": quantum, "error": quantum + 2.0 * passivity.noise}
    return {**own, **{name: getattr(passivity, name) for name in names}}


def _of_safety(config: HandConfig) -> dict[str, Any]:
    names = ("ramp_time", "slew", "clamp", "thermal_time", "decay_after", "disarm_after")
    own = {"period": 1.0 / config.chain.rate, "continuous": config.safety.continuous_force}
    return {**own, **{name: getattr(config.safety, name) for name in names}}


def _of_paper(config: HandConfig) -> dict[str, Any]:
    chain = config.chain
    return {
        "alpha": (chain.force_filter or LowPass(alpha=RELEASE_ALPHA, rate=2.0 * RELEASE_RATE)).alpha,
        "distance_damping": chain.distance_damping,
        "messages": chain.messages_per_state,
        "trap": config.traps[0],
    }


def _of_curve(law: Law) -> dict[str, Any]:
    """A curve as the release's node knows it; zeros for a law that has none, which no hand in paper mode has."""
    curve = curve_law(law)
    names = ("stiffness", "threshold", "inverse_square", "offset", "cutoff")
    return {name: getattr(curve, name) for name in names} if curve else {}


def _felt(configs: Sequence[HandConfig], scene: FeltScene, device: wp.Device) -> Any:
    """`kernels.local_model.Felt` of a scene."""
    felt, laws = Felt(), scene.laws
    counts = [len(config.traps) for config in configs]
    felt.trap_count = wp.array(counts, dtype=wp.int32, device=device)
    felt.trap = wp.array(scene.trap, dtype=wp.int32, device=device)
    felt.law = wp.array(scene.law, dtype=wp.int32, device=device)
    rows = np.array(laws.rows).reshape(-1, len(local_rows.LAW))
    felt.row = wp.array(rows, dtype=wp.float64, device=device)
    first = np.searchsorted(scene.kinds, np.arange(scene.law.shape[2] + 1))
    felt.first = wp.array(first, dtype=wp.int32, device=device)
    slow = [config.chain.pose_filter for config in configs]
    alpha = [low.at(config.chain.rate).alpha if low else 1.0 for low, config in zip(slow, configs, strict=True)]
    felt.alpha = wp.array(alpha, dtype=wp.float64, device=device)
    felt.tables = _tables(laws, device)
    return felt


def _tables(laws: PackedLaws, device: wp.Device) -> Any:
    """Force tables as `otwarp.kernels.optics.force_table` reads them, in float64."""
    tables = ForceTableData()
    level = kernel_module("core.table_data", "float64").GridLevel
    node = np.array(laws.node).reshape(-1, 4)
    levels = np.frombuffer(laws.level.tobytes(), dtype=level.numpy_dtype())
    tables.node = wp.array(node, dtype=wp.vec4d, device=device)
    tables.level = wp.array(levels, dtype=level, device=device)
    tables.level_start = wp.array(np.array(laws.start), dtype=wp.int32, device=device)
    return tables
