"""The chain of a hand for the device that it turns out to hold; what a servo in a process of its own is handed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.core.config import HandConfig, SafetyConfig
from otwarp.haptics.core.types import DeviceInfo
from otwarp.haptics.force.law import Law, local_model


def make_chain(config: HandConfig, laws: Mapping[int, Sequence[Law]], kinds: Sequence[int], info: DeviceInfo) -> Chain:
    """A chain, disarmed, that asks no more of a device than it can give.

    `functools.partial(make_chain, config, laws, kinds)` is what `servo.process.HandSetup` wants: it goes to another
    interpreter by name.

    Args:
        config: Of the hand.
        laws, kinds: As `law.local_model`.
        info: Of the device, once it is open.

    Raises:
        InputError: As `Chain` and `local_model`.
    """
    config = replace(config, safety=within(config.safety, info))
    return Chain(config, local_model(config, laws, kinds))


def within(safety: SafetyConfig, info: DeviceInfo) -> SafetyConfig:
    """Limits of the configuration or of the device, whichever are lower; a device without motors has none."""
    if info.force <= 0.0:
        return safety
    continuous = min(safety.continuous_force, info.continuous_force or info.force)
    return replace(safety, clamp=min(safety.clamp, info.force), continuous_force=continuous)
