"""The hash of a pruning point: who accepts a point accepts this, and nothing that differs from it is cut."""

import hashlib

import msgspec

from rolling_panda.messages import PruningPoint


def point_digest(point: PruningPoint) -> str:
    """What is cut and where, as 32 hexadecimal digits.

    They are the first half of SHA-256 over the MessagePack array [point_id, revision, kind, position, tangent,
    nodes_kept, vine, spur] with numbers of position and tangent as 64-bit floats. What perception goes on measuring
    without changing the cut (radius, confidence, distances) is left out, so that a revision has one hash.
    """
    content = (
        point.point_id,
        point.revision,
        point.kind,
        tuple(float(value) for value in point.position),
        tuple(float(value) for value in point.tangent),
        point.nodes_kept,
        point.vine,
        point.spur,
    )
    return hashlib.sha256(msgspec.msgpack.encode(content)).hexdigest()[:32]
