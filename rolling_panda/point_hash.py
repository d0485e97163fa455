"""What an acceptance binds: the geometry of a pruning point, as one hash."""

import hashlib

import msgspec

from rolling_panda.messages import PruningPoint


def point_hash(point: PruningPoint) -> str:
    """32 hexadecimal digits over id, revision, position, tangent and radius: what decides where the blades close."""
    bound = (point.point_id, point.revision, point.position, point.tangent, point.radius)
    return hashlib.sha256(msgspec.msgpack.encode(bound)).hexdigest()[:32]
