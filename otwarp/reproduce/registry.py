"""The items of the report, in its order: one row each."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from otwarp.errors import InputError
from otwarp.reproduce.item import Item
from otwarp.reproduce.items import (
    chain,
    contract,
    delivery,
    force_curves,
    networks,
    rendering,
    setup,
    strategy_a,
    strategy_b,
    user_study,
)

ITEMS: dict[str, Item] = {
    item.name: item
    for item in (
        Item(
            name="setup",
            title="The setup",
            about="parameters: theirs with their grades, ours",
            run=setup.run,
            scenes=("strategy_a", "strategy_b", "cell_delivery"),
        ),
        Item(
            name="force_curves",
            title="Force curves and their fits",
            about="eq. 1 with the release's constants, beside fits of exact forces, axial and radial",
            run=force_curves.run,
        ),
        Item(
            name="strategy_a",
            title="Motion fidelity, strategy A",
            about="tilt θ against trap spacing d*, two equal traps; RMSE 3.31°, MAE 2.71°",
            run=strategy_a.run,
            scenes=("strategy_a",),
        ),
        Item(
            name="strategy_b",
            title="Motion fidelity, strategy B",
            about="tilt θ against trap spacing d* at power distribution m = 1.5; RMSE 1.54°, MAE 1.29°",
            run=strategy_b.run,
            scenes=("strategy_b",),
        ),
        Item(
            name="rendering",
            title="Accuracy of the rendered force",
            about="rendered against model force, axial and radial: MSE, RMSE, R² 0.9525 and 0.9268",
            run=rendering.run,
        ),
        Item(
            name="delivery",
            title="Cell delivery: trajectories, contact force, distance",
            about="contact force 2.57 ± 3.18 pN, distance 0.02 ± 0.026, warning lines 10 pN and 0.2",
            run=delivery.run,
            scenes=("cell_delivery",),
        ),
        Item(
            name="user_study",
            title="The user study, with simulated operators",
            about="deliveries 8 of 10 with haptics, 3 of 10 without: simulated operators under both conditions",
            run=user_study.run,
            scenes=("cell_delivery",),
        ),
        Item(
            name="networks",
            title="Pose and depth networks",
            about="accuracy, F1 and depth RMSE of VGG16, ResNet18 and ResNet50",
            run=networks.run,
            scenes=("strategy_b",),
        ),
        Item(
            name="chain",
            title="The signal chain",
            about="stiffest springs 414, 10.3 and 1.4 N/m, filters, latency",
            run=chain.run,
        ),
        Item(
            name="contract",
            title="The middleware contract",
            about="topics, types, rates and pairings of the release",
            run=contract.run,
        ),
    )
}
"""By name."""


def chosen(names: Sequence[str]) -> list[Item]:
    """Items by name, each once, in the report's order; all of them for none.

    Raises:
        InputError: An unknown name.
    """
    for name in names:
        if name not in ITEMS:
            near = difflib.get_close_matches(name, ITEMS, n=1, cutoff=0.4)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise InputError(f"--only is {name}; allowed: {', '.join(ITEMS)}{hint}")
    return [item for name, item in ITEMS.items() if not names or name in names]
