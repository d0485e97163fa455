"""What perception may be told: the pruning rule's numbers, what counts as seen, and how points are tracked."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.config import Positive

Hits = Annotated[int, Meta(ge=1, le=1000)]


class RuleConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """The spur-pruning rule. Lengths along the cane in metres.

    Attributes:
        system: How the vines are trained: `spur` (cordon) or `guyot`.
        nodes_kept: Count nodes that stay on the new spur; the basal bud is not counted.
        fruiting_nodes: The same on a Guyot vine's new cane.
        keeper_diameter: The lowest cane at least this thick becomes the new spur, else the thickest (m).
        offset: Cut this far past the last kept node (m).
        shift: By so much at most a cut is moved along the cane to keep another cane out of the blades (m).
        short_internode: Where the next node is nearer than this, cut midway instead (m).
        basal_reach: A node nearer to the cane's base than this is the basal bud (m).
        clear_beyond: This much cane past the last kept node must be in plain view (m).
        pruned: A cane that ends sooner than this past it has been pruned already (m).
        node_room: A hidden stretch at least this far from every seen node might hide another node (m).
        diameter_doubt: A diameter seen once and closer to `keeper_diameter` than this leaves the choice in doubt; over
            more looks the less, by the root of their number (m).
        steadiest: So many looks count for that at most: what they have in common does not average out.
        crowded: Nodes nearer to each other than this past the basal bud may belong to two canes (m).
        shortest_internode: The same for two that both stay (m).
        longest_internode: Between nodes farther apart than this one was missed, or seen as something else (m).
        height_doubt: Canes whose bases differ in height by less than this cannot be told apart by it (m).
        stub_room: Least free stub between the keeper and the next cane for one cut that removes the rest (m).
        shears_room: Wood that must stay keeps at least this distance from the cut (m).
        crossing: Another cane this near to the cut would be between the open blades too: half their opening (m).
        base_doubt: A cane whose base is hidden over more than this cannot have its nodes counted (m).
        largest_diameter: Thicker wood is refused (m).
        wire_distance: No cut is proposed nearer to a wire or a hose than this: 15 mm, and what a pixel is wide (m).
        blade_reach: So far to either side of the wood the open blades stand (m).
        blade_room: Where there is a choice, a wire is this far from the middle of each (m): what the controller keeps,
            with half a blade's width.
        cordon_distance: The same for cordon and trunk (m).
        node_distance: The same for nodes that stay (m).
    """

    system: Literal["spur", "guyot"] = "spur"
    nodes_kept: Annotated[int, Meta(ge=1, le=5)] = 2
    fruiting_nodes: Annotated[int, Meta(ge=3, le=20)] = 8
    keeper_diameter: Positive = 0.006
    offset: Positive = 0.020
    shift: Positive = 0.0085
    short_internode: Positive = 0.040
    basal_reach: Positive = 0.055
    clear_beyond: Positive = 0.030
    pruned: Positive = 0.045
    node_room: Positive = 0.035
    diameter_doubt: Positive = 0.00035
    steadiest: Annotated[int, Meta(ge=1, le=100)] = 9
    crowded: Positive = 0.03
    shortest_internode: Positive = 0.05
    longest_internode: Positive = 0.125
    height_doubt: Positive = 0.004
    stub_room: Positive = 0.016
    shears_room: Positive = 0.022
    base_doubt: Positive = 0.018
    crossing: Positive = 0.015
    largest_diameter: Positive = 0.015
    wire_distance: Positive = 0.0165
    blade_reach: Positive = 0.021
    blade_room: Positive = 0.0146
    cordon_distance: Positive = 0.020
    node_distance: Positive = 0.010


class SkeletonConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """How pixels become canes.

    Attributes:
        nearest: Depths below this are no measurement (m).
        farthest: Wood beyond this belongs to another row (m).
        depth_step: Neighbouring pixels that differ by more belong to different canes (m).
        least_pixels: Smaller pieces of skeleton are dropped (px).
        bridge: Longest hidden stretch over which two pieces may be one cane (m).
        bend: Largest change of direction over such a stretch (rad).
        miss: How far the straight continuation of one piece may pass by the other (m).
        sample: Distance of samples along a cane (m).
        smoothing: Standard deviation of the kernel that smooths a cane's axis (m).
        reach: A cane grows from the spur or cordon within this distance of its base (m).
        stray: A cane whose base is hidden but within this distance of a spur may be one of its canes (m).
        border: A spur nearer than this to the image's edge may have canes out of view (px).
        least_cane: Shorter pieces are not called canes (m).
        least_node_pixels: Smaller node blobs are ignored (px).
        widening: So much wider than they are canes come out of the segmenter (px); it says so itself.
    """

    nearest: Positive = 0.15
    farthest: Positive = 1.6
    depth_step: Positive = 0.012
    least_pixels: Annotated[int, Meta(ge=2, le=100)] = 4
    bridge: Positive = 0.06
    bend: Positive = 0.5
    miss: Positive = 0.008
    sample: Positive = 0.005
    smoothing: Positive = 0.012
    reach: Positive = 0.035
    stray: Positive = 0.09
    border: Annotated[float, Meta(ge=0.0, le=1000.0)] = 30.0
    least_cane: Positive = 0.03
    least_node_pixels: Annotated[int, Meta(ge=1, le=100)] = 4
    widening: Annotated[float, Meta(ge=-3.0, le=3.0)] = 0.0


class TrackerConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """How points keep their identity from frame to frame.

    Attributes:
        association: A cut this near to a known point is the same one (m).
        hits: Frames that must agree before a point is shown.
        sparse_hits: After `sparse_looks` at a spur so many suffice, where no other frame said anything else.
        sparse_looks: See there.
        memory: Frames that a running average looks back.
        moved: A point that has moved by more than this gets a new revision (m).
        turned: The same for its tangent (rad).
        gone: Frames that must show the cane gone before its point is withdrawn.
        probe: The cane is looked for this far past the cut (m).
        vine_spacing: Distance between vines (m), for numbering where no trunk is in view.
        spur_separation: Spur positions nearer than this are one (m).
    """

    association: Positive = 0.03
    hits: Hits = 3
    sparse_hits: Hits = 2
    sparse_looks: Hits = 6
    memory: Hits = 20
    moved: Positive = 0.004
    turned: Positive = 0.15
    gone: Hits = 3
    probe: Positive = 0.025
    vine_spacing: Positive = 1.8
    spur_separation: Positive = 0.045


class LookConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """A closer look at one point.

    Attributes:
        nearest: The camera may be this near (m).
        farthest: And this far (m).
        window: Half the side of what is looked at around the point (m).
        beyond: The cane stands when it goes on this far past the cut (m).
        aside: A cane farther beside the point than this is another one (m).
        short: A cane that ends this near to the cut, before or after it, may still be its cane (m).
        aligned: Cosine of the largest angle between the cane and the point's tangent.
        node_shift: The last node that stays may be seen so far from where it was, along the cane (m).
        node_room: A cut keeps this far from every node (m).
    """

    nearest: Positive = 0.25
    farthest: Positive = 0.55
    window: Positive = 0.09
    beyond: Positive = 0.02
    aside: Positive = 0.012
    short: Positive = 0.02
    aligned: Positive = 0.85
    node_shift: Positive = 0.008
    node_room: Positive = 0.008


class Thickest(Struct, frozen=True, forbid_unknown_fields=True):
    """Greatest plausible radius of a post, of a trunk, and of a cordon (m)."""

    post: Positive = 0.09
    trunk: Positive = 0.07
    cordon: Positive = 0.04


class ObstacleConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """What becomes an obstacle that the arm keeps away from.

    Attributes:
        nearest: Pixels nearer than this are not used (m).
        thick_nearest: The same of posts, trunks and cordons: from near by, a network takes one for another, and wire or
            canes for any of them, and what is as thick has been seen from farther away before (m).
        farthest: The same for farther ones (m).
        cell: Size of the cells in which points are gathered (m).
        hits: Frames that must have shown a cell, more than refuted it.
        cells: Cells of each kind that are remembered at most; the farthest are forgotten.
        points: Pixels of one class used of a frame, about.
        least: Cells that a rod needs.
        shortest: Length that a rod needs (m).
        apart: Posts and trunks farther apart than this along the row are two (m).
        wire_apart: Wires farther apart than this in height are two (m).
        piece: A cordon is cut into pieces of this length (m).
        piece_apart: What is farther than this above, below or behind the rest of a piece is no part of it (m).
        off_row: What is farther than this before or behind the row is none of its wood (m).
        lean: A post or a trunk that leans by more than this is none (rad).
        turn: The same of a cordon's or a wire's angle to the row (rad).
        thickest: What is thicker is none of its kind.
        most: Rods kept at most; of canes the nearest.
        canes: Whether what stays of the canes is among them.
    """

    nearest: Positive = 0.2
    thick_nearest: Positive = 0.5
    farthest: Positive = 2.0
    cell: Positive = 0.02
    hits: Hits = 3
    cells: Annotated[int, Meta(ge=1000, le=10**7)] = 50000
    points: Annotated[int, Meta(ge=10, le=100000)] = 4000
    least: Annotated[int, Meta(ge=2, le=1000)] = 4
    shortest: Positive = 0.05
    apart: Positive = 0.15
    wire_apart: Positive = 0.06
    piece: Positive = 0.15
    piece_apart: Positive = 0.06
    off_row: Positive = 0.15
    lean: Positive = 0.26
    turn: Positive = 0.6
    thickest: Thickest = Thickest()
    most: Annotated[int, Meta(ge=1, le=500)] = 200
    canes: bool = True


class PerceptionConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Section `[perception]`.

    Attributes:
        rate_hz: Turns of the process's loop a second; one heartbeat each.
        hang_s: A frame that takes longer than this stops the heartbeat (s).
        survey_nearest: A frame with the cordon nearer than this is no survey: it shows parts of spurs only, so that it
            may confirm that wood has gone and propose nothing (m).
        survey_farthest: The same for a cordon farther away, where canes are too thin in the image (m).
        upright: Least cosine of the angle between the image's upward direction and the vertical. A camera turned over,
            as by a hand that jogs a joint, sees what no network was trained on: such a frame changes nothing.
        segmenter: Says which pixel shows what: `network`, or `labels`, the simulated camera's own, for comparison.
        weights: ONNX file for the network; empty takes the one that is shipped.
        threads: Of the network. With fewer than the machine has cores a frame takes longer; the loop that drives the
            robot goes first either way.
        fuse: Whether the rule is applied to what all frames have shown of a spur, or to each frame alone.
        rule: Where to cut.
        skeleton: Pixels to canes.
        tracker: Points over time.
        obstacles: What the arm keeps away from.
        look: A closer look at one point.
    """

    rate_hz: Positive = 20.0
    hang_s: Positive = 3.0
    survey_nearest: Positive = 0.55
    survey_farthest: Positive = 1.1
    upright: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.8
    segmenter: Literal["network", "labels"] = "network"
    weights: str = ""
    threads: Annotated[int, Meta(ge=1, le=64)] = 2
    fuse: bool = False
    rule: RuleConfig = RuleConfig()
    skeleton: SkeletonConfig = SkeletonConfig()
    tracker: TrackerConfig = TrackerConfig()
    obstacles: ObstacleConfig = ObstacleConfig()
    look: LookConfig = LookConfig()
