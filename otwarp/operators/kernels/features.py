"""What a chain has, from which its step is composed; what it lacks is not compiled."""

from __future__ import annotations

from dataclasses import dataclass

from otwarp.haptics.core.config import HandConfig


@dataclass(frozen=True, kw_only=True)
class ChainFeatures:
    """What a chain of hands has.

    Attributes:
        models: Force laws that are summed, by their names in `otwarp.kernels.optics.local_force.FELT`.
        paper: Whether it is the public release's.
        passivity: Whether its force is bounded by energy, and controlled unless it is the release's; energy is always
            counted.
        velocity: Whether anything needs the hand's velocity.
        windowed: Whether it is estimated within a noise margin.
        damping, coupling, force_filter, motion_filter: Whether there is one.
        glides: Whether sphere positions are filtered.
        predicts: Whether spheres are taken to follow the hand between states.
        absolute: Whether traps follow the place of the hand.
        slowed: Whether the hand's traps have a largest speed.
        clutch, dead_man: Whether these buttons count.
    """

    models: tuple[str, ...]
    paper: bool
    passivity: bool
    velocity: bool
    windowed: bool
    damping: bool
    coupling: bool
    force_filter: bool
    motion_filter: bool
    glides: bool
    predicts: bool
    absolute: bool
    slowed: bool
    clutch: bool
    dead_man: bool

    @classmethod
    def of(cls, config: HandConfig, models: tuple[str, ...]) -> ChainFeatures:
        """Of the chain of one hand.

        Args:
            config: Of the hand.
            models: Names of all laws of the scene's hands.
        """
        chain = config.chain
        paper = chain.mode == "paper"
        passivity = chain.passivity is not None
        damping = chain.damping > 0.0
        low_pass = chain.motion_filter
        return cls(
            models=() if paper else models,
            paper=paper,
            passivity=passivity,
            velocity=damping or (passivity and not paper),
            windowed=chain.quantum > 0.0,
            damping=damping,
            coupling=chain.coupling is not None,
            force_filter=chain.force_filter is not None and not paper,
            motion_filter=low_pass is not None and low_pass.alpha < 1.0,
            glides=chain.pose_filter is not None and chain.pose_filter.alpha < 1.0 and not paper,
            predicts=chain.pose_prediction and not paper,
            absolute=config.absolute,
            slowed=chain.trap_speed < float("inf") and not config.absolute,
            clutch=config.clutch,
            dead_man=config.safety.dead_man,
        )
