"""Configuration of perception: pruning rule, skeleton, tracker, close-up checks and obstacles."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.config import Positive

Count = Annotated[int, Meta(ge=1, le=1000)]


class RuleConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Numbers of the pruning rule. Lengths along the cane in metres.

    Attributes:
        system: Training system of the vines: `spur` (cordon) or `guyot`.
        nodes_kept: Count nodes left on the new spur; the basal bud is not counted.
        fruiting_nodes: Count nodes left on the fruiting cane of a Guyot vine.
        preferred_diameter: The lowest cane at least this thick becomes the new spur, else the thickest (m).
        offset: Distance of the cut past the last kept node (m).
        max_shift: Longest shift of the cut along the cane to clear other wood (m).
        short_internode: The cut is midway to the next node where that is nearer than this (m).
        basal_bud_distance: A node nearer to the base than this is the basal bud (m).
        visible_beyond: Length past the last kept node that must be visible (m).
        pruned_length: A cane that ends within this length past the last kept node is already pruned (m).
        hidden_node_distance: A hidden stretch at least this far from every seen node may hide a node (m).
        diameter_error: Standard error of a diameter from one frame (m). A choice that turns on less is undecided.
        max_averaged: The error falls with the root of the number of frames, up to this number.
        shared_diameter_error: Standard error of a diameter that all frames of a cane share (m). A cut is less sure, and
            says so, where the choice of its cane turns on less.
        min_node_distance: Nodes closer than this past the basal bud may belong to two canes (m).
        min_internode: The same for two kept nodes (m).
        max_internode: Between kept nodes farther apart than this a node was missed (m).
        height_error: Canes whose bases differ in height by less than this cannot be ordered (m).
        min_stub: Shortest free stub between the keeper and the next cane for a renewal cut (m).
        shears_clearance: Distance of the keeper from a renewal cut in the plane of the blades, on either side and in
            depth (m), within `blade_half` of that plane.
        blade_half: Half the thickness of the blades, with the radius of a cane and the error of its place (m).
        blade_turn: Largest turn of the blades about the wood in a renewal cut (rad), that of the controller.
        blade_tilt: Their largest tilt out of the plane square to the wood (rad), that of the controller.
        blade_lean: Their largest lean about the approach (rad); where it must the controller leans them more.
        crossing_distance: Distance of other canes from a cut: half the opening of the blades (m).
        max_base_gap: Longest hidden stretch at the base of a cane whose nodes can be counted (m).
        max_diameter: Thickest cane that the shears may cut (m).
        max_stub_diameter: Thickest stub that the shears may cut (m).
        wire_distance: Distance of wires and hoses from a cut: 15 mm and one pixel (m).
        blade_reach: Distance of the open blades from the axis of the wood (m).
        blade_clearance: Preferred distance of a wire from the middle of each blade: that of the controller and half
            the width of a blade (m).
        cordon_distance: Distance of cordon and trunk from a cut (m).
        node_distance: Distance of kept nodes from a cut (m).
    """

    system: Literal["spur", "guyot"] = "spur"
    nodes_kept: Annotated[int, Meta(ge=1, le=5)] = 2
    fruiting_nodes: Annotated[int, Meta(ge=3, le=20)] = 8
    preferred_diameter: Positive = 0.006
    offset: Positive = 0.020
    max_shift: Positive = 0.0085
    short_internode: Positive = 0.040
    basal_bud_distance: Positive = 0.055
    visible_beyond: Positive = 0.030
    pruned_length: Positive = 0.045
    hidden_node_distance: Positive = 0.035
    diameter_error: Positive = 0.00035
    max_averaged: Annotated[int, Meta(ge=1, le=100)] = 9
    shared_diameter_error: Positive = 0.00036
    min_node_distance: Positive = 0.03
    min_internode: Positive = 0.05
    max_internode: Positive = 0.125
    height_error: Positive = 0.004
    min_stub: Positive = 0.016
    shears_clearance: Positive = 0.022
    blade_half: Positive = 0.006
    blade_turn: Positive = 0.7
    blade_tilt: Positive = 0.26
    blade_lean: Positive = 0.44
    max_base_gap: Positive = 0.018
    crossing_distance: Positive = 0.015
    max_diameter: Positive = 0.015
    max_stub_diameter: Positive = 0.020
    wire_distance: Positive = 0.0165
    blade_reach: Positive = 0.021
    blade_clearance: Positive = 0.0146
    cordon_distance: Positive = 0.020
    node_distance: Positive = 0.010


class SkeletonConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """From pixels to canes.

    Attributes:
        min_depth: Smallest valid depth (m).
        max_depth: Wood beyond this depth belongs to another row (m).
        depth_step: Depth step between neighbouring pixels of different canes (m).
        depth_reach: Depth that the camera lost is interpolated so far from a pixel that has it, along the wood (m).
        min_fragment_pixels: Shorter skeleton fragments are dropped (px).
        max_gap: Longest hidden gap between two fragments of one cane (m).
        max_bend: Largest change of direction over such a gap (rad).
        max_lateral_offset: Largest distance of one fragment from the straight continuation of the other (m).
        sample_spacing: Distance between samples of a cane's axis (m).
        smoothing_sigma: Standard deviation of the kernel that smooths the axis (m).
        root_distance: Largest distance of a cane's base from its spur (m).
        stray_distance: A cane with its base within this distance of a spur, yet not rooted, may be one of its own (m).
        border_margin: A spur nearer than this to the image border may have canes out of view (px).
        min_cane_length: Shorter pieces are not canes (m).
        min_node_pixels: Smaller node blobs are ignored (px).
        width_bias: By how much the segmenter draws canes too wide (px); set from the segmenter.
    """

    min_depth: Positive = 0.15
    max_depth: Positive = 1.6
    depth_step: Positive = 0.012
    depth_reach: Positive = 0.02
    min_fragment_pixels: Annotated[int, Meta(ge=2, le=100)] = 4
    max_gap: Positive = 0.06
    max_bend: Positive = 0.5
    max_lateral_offset: Positive = 0.008
    sample_spacing: Positive = 0.005
    smoothing_sigma: Positive = 0.012
    root_distance: Positive = 0.035
    stray_distance: Positive = 0.09
    border_margin: Annotated[float, Meta(ge=0.0, le=1000.0)] = 30.0
    min_cane_length: Positive = 0.03
    min_node_pixels: Annotated[int, Meta(ge=1, le=100)] = 4
    width_bias: Annotated[float, Meta(ge=-3.0, le=3.0)] = 0.0


class TrackerConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Data association and life cycle of pruning points.

    Attributes:
        association_distance: Largest distance of a proposal from its track (m).
        min_hits: Frames that must agree before a point is published.
        sparse_hits: Frames that suffice after `sparse_observations` of a spur, without a competing track.
        sparse_observations: See `sparse_hits`.
        min_viewpoints: Viewpoints that must agree as well, or half of those that have shown the spur, if that is less.
        averaging_window: Frames that a running mean covers.
        position_tolerance: A point that moved farther gets a new revision (m).
        tangent_tolerance: The same for the tangent (rad).
        gone_frames: Frames that must show the cane gone before its point is withdrawn.
        probe_distance: The cane is checked this far past the cut (m).
        vine_spacing: Distance between vines, for numbers where no trunk is in view (m).
        spur_separation: Spur positions nearer than this are one spur (m); across the row 0.6 of a distance counts.
    """

    association_distance: Positive = 0.03
    min_hits: Count = 3
    sparse_hits: Count = 2
    sparse_observations: Count = 6
    min_viewpoints: Count = 3
    averaging_window: Count = 20
    position_tolerance: Positive = 0.004
    tangent_tolerance: Positive = 0.15
    gone_frames: Count = 3
    probe_distance: Positive = 0.025
    vine_spacing: Positive = 1.8
    spur_separation: Positive = 0.045


class CloseUpConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Close-up check of one point.

    Attributes:
        min_distance: Smallest distance of the camera (m).
        max_distance: Largest distance of the camera (m).
        half_window: Half the side of the image window around the point (m).
        probe_distance: The cane is standing when it continues this far past the cut (m).
        max_lateral_offset: Largest distance of the cane's axis from the point, beyond the shift of the picture (m).
        sure_offset: Where the surroundings do not tell the cane, its axis must be nearer to the point than this (m).
        max_end_gap: Largest distance along the cane between its end and the point (m).
        min_alignment: Smallest cosine of the angle between the cane and the point's tangent.
        max_node_shift: Largest shift of the last kept node along the cane (m).
        node_clearance: Distance of every node from the cut (m).
    """

    min_distance: Positive = 0.25
    max_distance: Positive = 0.55
    half_window: Positive = 0.09
    probe_distance: Positive = 0.02
    max_lateral_offset: Positive = 0.012
    sure_offset: Positive = 0.005
    max_end_gap: Positive = 0.02
    min_alignment: Positive = 0.85
    max_node_shift: Positive = 0.008
    node_clearance: Positive = 0.008


class SightConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Pictures of a cut on the last way to it.

    Attributes:
        min_distance: Smallest distance of the camera (m): nearer it measures no depth.
        max_distance: Largest distance of the camera (m).
        half_window: Half the side of the image window around the cut (m).
        sure_shift: By so much the cane may be seen aside of where it was seen last, whenever that was (m).
        max_speed: Largest speed of a swaying cane at the cut (m/s).
        max_shift: It is never looked for farther from where it was seen last (m).
        separation: Another cane has to be farther away than the nearest one by this (m).
        min_alignment: Smallest cosine of the angle between a cane and the one that is followed.
    """

    min_distance: Positive = 0.19
    max_distance: Positive = 0.55
    half_window: Positive = 0.035
    sure_shift: Positive = 0.005
    max_speed: Positive = 0.10
    max_shift: Positive = 0.015
    separation: Positive = 0.004
    min_alignment: Positive = 0.85


class MaxRadius(Struct, frozen=True, forbid_unknown_fields=True):
    """Largest plausible radius of a post, of a trunk, and of a cordon (m)."""

    post: Positive = 0.09
    trunk: Positive = 0.07
    cordon: Positive = 0.04


class ObstacleConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """What becomes an obstacle for the arm.

    Attributes:
        min_depth: Smallest depth of wire pixels (m).
        min_depth_thick: The same for posts, trunks and cordons. The network confuses these classes close up, and wood
            as thick was seen from farther away before (m).
        max_depth: Largest depth of all pixels (m).
        cell_size: Side of a grid cell (m).
        min_hits: Frames that must have shown a cell, more than refuted it.
        max_cells: Cells of each class; the farthest are dropped.
        max_points: Pixels of one class used of a frame, approximately.
        min_cells: Cells that a cylinder needs.
        min_length: Length that a cylinder needs (m).
        upright_separation: Posts and trunks farther apart than this along the row are two (m).
        wire_separation: Wires farther apart than this in height are two (m).
        cordon_piece: A cordon is split into pieces of this length (m).
        cordon_separation: Cells of a piece with a gap of this across the row are two cordons (m).
        row_tolerance: Wood farther than this from the row plane is rejected (m).
        max_lean: Largest angle of a post or a trunk from the vertical (rad).
        max_slope: Largest angle of a cordon or a wire from the row (rad).
        max_radius: Thicker cylinders are rejected.
        max_capsules: Capsules published, the nearest first.
        canes: Whether the canes that stay are published too.
    """

    min_depth: Positive = 0.2
    min_depth_thick: Positive = 0.5
    max_depth: Positive = 2.0
    cell_size: Positive = 0.02
    min_hits: Count = 3
    max_cells: Annotated[int, Meta(ge=1000, le=10**7)] = 50000
    max_points: Annotated[int, Meta(ge=10, le=100000)] = 4000
    min_cells: Annotated[int, Meta(ge=2, le=1000)] = 4
    min_length: Positive = 0.05
    upright_separation: Positive = 0.15
    wire_separation: Positive = 0.06
    cordon_piece: Positive = 0.15
    cordon_separation: Positive = 0.06
    row_tolerance: Positive = 0.15
    max_lean: Positive = 0.26
    max_slope: Positive = 0.6
    max_radius: MaxRadius = MaxRadius()
    max_capsules: Annotated[int, Meta(ge=1, le=500)] = 200
    canes: bool = True


class PerceptionConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Section `[perception]`.

    Attributes:
        rate_hz: Rate of the process's loop and heartbeat.
        frame_timeout_s: A frame that takes longer stops the heartbeat.
        survey_min_depth: Smallest median depth of the cordon in a survey frame (m). A nearer frame shows parts of
            spurs only: it proposes nothing, but may confirm that wood is gone.
        survey_max_depth: Largest median depth of the cordon in a survey frame; canes farther away are too thin (m).
        min_upright: Smallest cosine of the angle between the image's upward direction and the vertical. Frames of a
            camera turned farther are ignored, since the network was not trained on them.
        segmenter: `network`, or `labels` for the label image of the simulated camera.
        weights: ONNX file of the network; empty for the one of `rolling-panda models use`, else the shipped one.
        threads: Threads of the network.
        localise: Whether wood that was seen before corrects the odometry; otherwise map and odom are one.
        fuse: Whether the rule is applied to the map of a spur over all frames, or to each frame alone. That of Guyot
            vines always is.
        rule: Pruning rule.
        skeleton: From pixels to canes.
        tracker: Pruning points over time.
        obstacles: Obstacles for the arm.
        close_up: Close-up check of one point.
        sight: Pictures of a cut on the last way to it.
    """

    rate_hz: Positive = 20.0
    frame_timeout_s: Positive = 3.0
    survey_min_depth: Positive = 0.55
    survey_max_depth: Positive = 1.1
    min_upright: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.8
    segmenter: Literal["network", "labels"] = "network"
    weights: str = ""
    threads: Annotated[int, Meta(ge=1, le=64)] = 2
    localise: bool = False
    fuse: bool = False
    rule: RuleConfig = RuleConfig()
    skeleton: SkeletonConfig = SkeletonConfig()
    tracker: TrackerConfig = TrackerConfig()
    obstacles: ObstacleConfig = ObstacleConfig()
    close_up: CloseUpConfig = CloseUpConfig()
    sight: SightConfig = SightConfig()
