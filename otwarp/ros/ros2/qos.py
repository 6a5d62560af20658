"""Quality of service: the profiles of ROS 2 that the bridge uses, and what they are called in Cyclone DDS.

Requested against offered: a best-effort reader takes from any writer, a reliable reader only from a reliable one; a
volatile reader takes from any, a transient-local one only from a transient-local writer. So the bridge writes reliably
and reads best-effort, which matches every node that keeps to ROS 2's default or sensor profile.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from otwarp.haptics.core.fields import check_fields, number

if TYPE_CHECKING:
    from cyclonedds.qos import Qos


@dataclass(frozen=True, slots=True, kw_only=True)
class QoS:
    """Policies of one publisher or subscription; deadlines, lifespans and leases are ROS 2's defaults: none.

    Attributes:
        reliability: `reliable` sends again what was lost.
        durability: `transient_local` keeps the last messages for who comes later.
        depth: Messages kept; more than these push out the oldest.
    """

    reliability: Literal["best_effort", "reliable"] = "best_effort"
    durability: Literal["volatile", "transient_local"] = "volatile"
    depth: int = number(10, 1, 10_000, "messages")

    def __post_init__(self) -> None:
        check_fields(self, "qos")

    def accepts(self, offered: QoS) -> bool:
        """Whether a reader with these policies matches a writer with those."""
        reliable = self.reliability == "best_effort" or offered.reliability == "reliable"
        durable = self.durability == "volatile" or offered.durability == "transient_local"
        return reliable and durable


SENSOR_DATA = QoS()
"""Best effort, keep last 10, volatile: what the RL companion subscribes with. (`rmw_qos_profile_sensor_data` keeps 5;
the depth is no matter of matching.)"""

RELIABLE = QoS(reliability="reliable")
"""ROS 2's default: reliable, keep last 10, volatile."""


def cyclone_qos(qos: QoS, *, user_data: bytes, reader: bool) -> Qos:
    """The policies as Cyclone DDS has them.

    A write never waits: the longest that a reliable writer may block is 0 s, and what is kept is bounded, so that a
    reader that falls behind loses the oldest messages instead of holding up the writer. A reader ignores the names of
    members, since ROS 2's own IDL template calls `data` `data_` and not every peer does.

    Args:
        qos: Policies.
        user_data: Of the endpoint; ROS 2 looks there for the hash of the type.
        reader: Whether it is for a subscription.
    """
    from cyclonedds.qos import Policy, Qos

    reliable = qos.reliability == "reliable"
    reliability = Policy.Reliability.Reliable(max_blocking_time=0) if reliable else Policy.Reliability.BestEffort
    durability = Policy.Durability.TransientLocal if qos.durability == "transient_local" else Policy.Durability.Volatile
    policies = [
        reliability,
        durability,
        Policy.History.KeepLast(qos.depth),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        Policy.Userdata(user_data),
    ]
    if reader:
        policies.append(
            Policy.TypeConsistency.AllowTypeCoercion(
                ignore_sequence_bounds=True,
                ignore_string_bounds=True,
                ignore_member_names=True,
                prevent_type_widening=False,
                force_type_validation=False,
            )
        )
    elif qos.durability == "transient_local":
        policies.append(
            Policy.DurabilityService(
                cleanup_delay=0,
                history=Policy.History.KeepLast(qos.depth),
                max_samples=-1,
                max_instances=-1,
                max_samples_per_instance=-1,
            )
        )
    return Qos(*policies)
