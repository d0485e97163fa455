"""The picture that goes with a pruning point."""

from typing import Annotated

from msgspec import Meta

from rolling_panda.messages import Count, Message, Name

#: Largest picture (bytes).
CROP_BYTES = 8192


class PointCrop(Message, frozen=True, kw_only=True):
    """Perception → server: what the camera saw of a point's spur, the cut in the middle.

    Attributes:
        point_id: Of the point.
        revision: That it shows.
        sequence: Of the camera frame that it was taken from.
        jpeg: The picture; black where the frame ended.
    """

    point_id: Name
    revision: Count
    sequence: Count
    jpeg: Annotated[bytes, Meta(max_length=CROP_BYTES)]
