"""Closer looks: the controller asks for a picture of one point, perception says what it shows."""

from typing import Literal

from rolling_panda import messages as m

#: `seen`: the cane stands and fits; `changed`: it stands but is not what was accepted; `severed`: the wood beyond the
#: cut is gone; `unseen`: the picture does not tell.
Finding = Literal["seen", "changed", "severed", "unseen"]


class PictureRequest(m.Message, frozen=True, kw_only=True):
    """Controller → bridge: take a picture of a point now. Repeated until seen; the bridge acts on a `number` once.

    Attributes:
        epoch: Of the controller, as in `MotionCommand`.
        number: Strictly increasing within an epoch.
        point_id: What is looked at; the frame carries it.
    """

    epoch: m.Count
    number: m.Count
    point_id: m.Name


class CloseLook(m.Message, frozen=True, kw_only=True):
    """Perception → controller: what a picture that was asked for shows of its point.

    Attributes:
        header: Stamp of the picture; `frame_id` is odom.
        point_id: The point.
        number: Of the request.
        finding: What it shows.
        reason: Why it is unseen or has changed, in words.
        position: Where its cut belongs as seen now (m, odom); None unless `seen`.
        tangent: Of the cane there; None unless `seen`.
        distance: Of the camera from the point (m).
        nodes: Places along the cane where nodes were seen (m beyond the cut, negative before it).
    """

    header: m.Header
    point_id: m.Name
    number: m.Count
    finding: Finding
    reason: m.Text = ""
    position: m.Vector3 | None = None
    tangent: m.UnitVector3 | None = None
    distance: m.NonNegative = 0.0
    nodes: tuple[m.Finite, ...] = ()
