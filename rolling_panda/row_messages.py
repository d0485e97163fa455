"""Messages about what stands in the row: what is in the robot's way, and the simulator's own picture of it."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.messages import Count, Header, Message, NonNegative, Vector3, WoodClass

#: Number of a vine or a spur, -1 for none.
Number = Annotated[int, Meta(ge=-1, le=10**6)]


class Capsule(Struct, frozen=True, forbid_unknown_fields=True):
    """A rod with round ends: axis from `start` to `end` (m), radii at both (m).

    `vine` and `spur`, numbers as pruning points have them, are of the spur that it grows from; -1 where there is none.
    `undecided` wood may yet be cut off: which cane of that spur stays was left to a person.
    """

    kind: WoodClass
    start: Vector3
    end: Vector3
    start_radius: NonNegative
    end_radius: NonNegative
    vine: Number = -1
    spur: Number = -1
    undecided: bool = False


class Scenery(Message, frozen=True, kw_only=True):
    """Simulated bridge → server: the row as it stands, for display only. Perception and control never subscribe.

    `revision` grows whenever something was severed.
    """

    header: Header
    revision: Count
    capsules: tuple[Capsule, ...]


class Obstacles(Message, frozen=True, kw_only=True):
    """Perception → controller: what stands in the way of base and arm, as far as it was seen.

    Attributes:
        header: `frame_id` is odom.
        capsules: Posts, trunks, cordons, wires, and of the canes what stays once the row is pruned, each with its vine
            and spur. What is to be cut off is not among them: it gives way.
    """

    header: Header
    capsules: tuple[Capsule, ...]
