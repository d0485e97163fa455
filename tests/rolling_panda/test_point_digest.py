"""The hash that an acceptance binds to."""

from msgspec.structs import replace

from rolling_panda.messages.perception import PruningPoint, PruningPoints, point_digest
from rolling_panda.messages.types import Header
from rolling_panda.transport.codec import StrictDecoder, encode
from tests.support.fake_wire import pruning_point


def test_it_tells_other_cuts_apart_and_stays_while_the_cut_does():
    point = pruning_point()
    others = (
        {"point_id": "p2"}, {"revision": 4}, {"kind": "renewal cut"}, {"position": (0.3, 0.85, 1.001)},
        {"tangent": (0.0, 1.0, 0.0)}, {"nodes_kept": 3}, {"vine": 2}, {"spur": 2},
    )  # fmt: skip
    digests = {point_digest(replace(point, **change)) for change in others} | {point_digest(point)}
    assert len(digests) == len(others) + 1
    assert point_digest(replace(point, confidence=0.1, radius=0.006, force=9.0)) == point_digest(point)


def test_it_survives_the_wire():
    point = pruning_point(position=(1, 2, 3))
    message = PruningPoints(header=Header(), segmenter="s", frames=1, points=(point,))
    received: PruningPoint = StrictDecoder(PruningPoints).decode(encode(message)).points[0]
    assert point_digest(received) == point_digest(point)
