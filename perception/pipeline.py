"""Camera frames in, pruning points out."""

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from perception.abstention import MoreToSee, OpenPlaces, abstention
from perception.album import Album, Crop
from perception.by_hand import moved_by_hand, point_by_hand
from perception.cane_lines import cane_lines
from perception.centreline import centrelines
from perception.clearance import Rods
from perception.close_look import look_closely, no_look
from perception.config import PerceptionConfig
from perception.fragments import find_fragments, find_wood
from perception.frame import View, decode_frame
from perception.keep_out import as_known, in_view
from perception.linking import link
from perception.mending import mended
from perception.numbering import RowNumbers, SpurNumber
from perception.obstacles import ObstacleMap
from perception.plant import Plant
from perception.plant_map import PlantMap
from perception.rules import apply_rule
from perception.segmenter import Segmenter
from perception.sightings import Sightings
from perception.staying import StayingCanes
from perception.topology import build_plant
from perception.tracker import Proposal, Tracked, Tracker
from rolling_panda import messages as m
from rolling_panda.camera_messages import CameraFrame
from rolling_panda.crop_messages import PointCrop
from rolling_panda.errors import InputError
from rolling_panda.look_messages import CloseLook
from rolling_panda.plant_requests import AddPoint, AddPointInImage, MovePoint, PlantRequest, SetRule
from rolling_panda.robot_model import RobotModel
from rolling_panda.row_messages import Capsule

_CORDON = m.WOOD_CLASSES.index("cordon")
#: A point by hand this near to another would be the same cut (m).
_TAKEN = 0.01
#: A shorter vector has no direction.
_SHORTEST = 1e-6
#: Fewer pixels of cordon say nothing about how far the row is.
_LEAST_CORDON = 200
#: A spur this near to the middle of the picture is before the camera (m).
_BEFORE_IT = 0.3


class Perception:
    """Sees the row frame by frame. No clock, no threads: the same frames give the same points."""

    def __init__(self, config: PerceptionConfig, segmenter: Segmenter, model: RobotModel | None = None) -> None:
        """Start with an unknown row.

        Args:
            config: Section `[perception]`.
            segmenter: Says which pixel shows what.
            model: For the camera's place; its work space is used, so it is not shared with another thread.
        """
        self._config = with_widening(config, segmenter.widening)
        self.segmenter = segmenter
        self._model = model or RobotModel()
        self._tracker = Tracker(config.tracker)
        self._numbers = RowNumbers(config.tracker.spur_separation, config.tracker.vine_spacing)
        self._frames = 0
        self._open = OpenPlaces()
        self._told: tuple[m.Abstention, ...] = ()
        self._stamp = 0.0
        self._canes: tuple[tuple[m.Vector3, ...], ...] = ()
        self._map = ObstacleMap(config.obstacles)
        self._staying = StayingCanes(config.obstacles)
        self._album = Album()
        self._crops: dict[str, PointCrop] = {}
        self.sightings = Sightings()
        """Where the camera was."""
        self.known = PlantMap()
        """The vines as known from all frames."""
        self.withdrawn: tuple[str, ...] = ()
        """What the last frame took away, with the reasons."""
        self.obstacles: tuple[Capsule, ...] = ()
        """What stands in the way, as far as it was seen."""

    def process(self, frame: CameraFrame) -> m.PruningPoints:
        """Take one frame in and tell everything held true now.

        Args:
            frame: As received.

        Raises:
            MessageError: The frame is corrupt; nothing changes.
        """
        view = decode_frame(frame, self._model)
        self._stamp = view.stamp
        self.sightings.note(frame)
        self.withdrawn = ()
        if -view.R[2, 1] < self._config.upright:
            return self._message(view, self._tracker.points(), self._told, self._canes)
        try:
            labels = self.segmenter.segment(view)
        except InputError as error:
            return self._message(view, self._tracker.points(), (abstention(str(error)),), ())
        rods = self._map.update(view, labels)
        self._frames += 1
        if not self._is_survey(view, labels):
            # Too near or too far to read a whole spur; near enough to see whether the wood still stands.
            tracked = self._tracker.update(view, labels, [])
            self._take(tracked)
            self._tell_obstacles(view, labels, rods, ())
            told = self._left_open(tracked.points) if self.known.spurs else (abstention(self._no_survey()),)
            return self._message(view, tracked.points, told, self._canes)
        plant = perceive(view, labels, self._config)
        numbers = self._numbers.number(plant, view.R[:, 0])
        spurs = self.known.update(plant, numbers)
        self._album.add(view, plant, numbers)
        fused = {spur.number: spur.as_spur() for spur in self.known.spurs} if self._config.fuse else {}
        keep_out = in_view(view, labels, self.obstacles, self._config.rule)
        proposals = []
        for seen, spur, number in zip(plant.spurs, spurs, numbers, strict=True):
            decision = apply_rule(fused.get(number, spur), self._config.rule, plant.beside(seen), keep_out)
            proposals += [Proposal(cut, number) for cut in decision.cuts]
            aside = abs(float(view.R[:, 0] @ (spur.position - view.t)))
            place = _vector(spur.position)
            self._open.note(number, bool(decision.cuts), list(decision.abstained), place, aside < _BEFORE_IT)
        looks = {spur.number: spur.position.looks for spur in self.known.spurs}
        tracked = self._tracker.update(view, labels, proposals, looks)
        self._take(tracked)
        self._tell_obstacles(view, labels, rods, numbers)
        self._canes = cane_lines(self.known)
        return self._message(view, tracked.points, self._left_open(tracked.points), self._canes)

    def look_closely(self, frame: CameraFrame) -> CloseLook:
        """What a picture that the controller asked for shows of its point, which is known better from then on.

        Args:
            frame: As received, with the point's name.

        Raises:
            MessageError: The frame is corrupt; nothing changes.
        """
        point = self._tracker.ever(frame.point_id)
        if point is None:
            return no_look(frame, "perception knows no such point")
        view = decode_frame(frame, self._model)
        try:
            look = look_closely(view, self.segmenter, point, frame.number, self._config)
        except InputError as error:
            return no_look(frame, str(error))
        if look.position is not None and look.tangent is not None:
            self._tracker.refine(point.point_id, np.array(look.position), np.array(look.tangent))
        return look

    @property
    def config(self) -> PerceptionConfig:
        """As it is now: with the segmenter's widening, and the rule that was set last."""
        return self._config

    def answer(self, request: PlantRequest) -> m.Answer:
        """Do what an operator asks for; a refusal changes nothing."""
        if isinstance(request, SetRule):
            return self._set_rule(request)
        if isinstance(request, MovePoint):
            return self._move(request)
        if isinstance(request, AddPoint):
            origin, direction = np.array(request.origin), np.array(request.direction)
        elif isinstance(request, AddPointInImage):
            line = self.sightings.line(request.sequence, request.u, request.v, self._model)
            if line is None:
                return m.Answer(ok=False, reason="that picture is not among the newest ones any more; click again")
            origin, direction = line.origin, line.direction
        else:
            return m.Answer(ok=False, reason=f"perception cannot do {type(request).__name__}")
        length = float(np.linalg.norm(direction))
        if length < _SHORTEST:
            return m.Answer(ok=False, reason="a line of sight needs a direction")
        direction = direction / length
        rule = self._config.rule
        found = point_by_hand(self.known, origin, direction, rule, self.obstacles, request.user)
        if isinstance(found, str):
            return m.Answer(ok=False, reason=found)
        for point in self._tracker.points():
            if float(np.linalg.norm(np.array(point.position) - found[0].position)) < _TAKEN:
                return m.Answer(ok=False, reason=f"{point.point_id} is there already, within {1000 * _TAKEN:.0f} mm")
        return m.Answer(ok=True, reason=self._tracker.add(Proposal(*found)).point_id)

    def points(self) -> m.PruningPoints:
        """Everything held true now, without a new frame."""
        return m.PruningPoints(
            header=m.Header(self._stamp, "odom"),
            segmenter=self.segmenter.name,
            frames=self._frames,
            points=self._explained(self._tracker.points()),
            abstained=self._told,
            canes=self._canes,
            rule=self._rule,
        )

    @property
    def crops(self) -> tuple[PointCrop, ...]:
        """A picture of every point shown whose spur some image shows, in the order of the points."""
        return tuple(self._crops.values())

    @property
    def _rule(self) -> m.PruningRule:
        rule = self._config.rule
        return m.PruningRule(
            system=rule.system,
            nodes_kept=rule.nodes_kept,
            fruiting_nodes=rule.fruiting_nodes,
            keeper_diameter=rule.keeper_diameter,
            offset=rule.offset,
        )

    def _explained(self, points: tuple[m.PruningPoint, ...]) -> tuple[m.PruningPoint, ...]:
        """The points with what stands around them; their pictures are renewed where a revision has none."""
        crops: dict[str, PointCrop] = {}
        for point in points:
            crop = self._crops.get(point.point_id)
            if crop is None or crop.revision != point.revision:
                cut = self._album.crop(SpurNumber(point.vine, point.spur), np.array(point.position))
                crop = None if cut is None else _crop_message(point, cut)
            if crop is not None:
                crops[point.point_id] = crop
        self._crops = crops
        places = np.array([point.position for point in points]).reshape(-1, 3)
        wires = Rods(self.obstacles, "wire").clearances(places)
        cordons = Rods(self.obstacles, "cordon").clearances(places)
        return tuple(
            replace(point, wire_distance=wire, cordon_distance=cordon)
            for point, wire, cordon in zip(points, wires, cordons, strict=True)
        )

    def _move(self, request: MovePoint) -> m.Answer:
        points = {point.point_id: point for point in self._tracker.points()}
        point = points.pop(request.point_id, None)
        if point is None:
            return m.Answer(ok=False, reason=f"perception does not see {request.point_id} any more")
        if point.kind == "renewal cut":
            return m.Answer(ok=False, reason="a renewal cut is on the old stub; reject it, and place one by hand")
        place, rule = np.array(point.position), self._config.rule
        cut = moved_by_hand(self.known, place, request.along, rule, self.obstacles, request.user)
        if isinstance(cut, str):
            return m.Answer(ok=False, reason=cut)
        return m.Answer(ok=True, reason=self._tracker.move(request.point_id, cut).reason)

    def _set_rule(self, request: SetRule) -> m.Answer:
        asked = request.rule
        rule = replace(
            self._config.rule,
            system=asked.system,
            nodes_kept=asked.nodes_kept,
            fruiting_nodes=asked.fruiting_nodes,
            keeper_diameter=asked.keeper_diameter,
            offset=asked.offset,
        )
        self._config = replace(self._config, rule=rule)
        spurs = {known.number: known.as_spur() for known in self.known.spurs}
        proposals = []
        keep_out = as_known(self.obstacles, rule)
        self._open.clear()
        for number, spur in spurs.items():
            beside = [cane.axis for other in spurs.values() if other is not spur for cane in other.canes]
            decision = apply_rule(spur, rule, np.concatenate([np.zeros((0, 3)), *beside]), keep_out)
            proposals += [Proposal(cut, number) for cut in decision.cuts]
            place = _vector(spur.position)
            self._open.note(number, bool(decision.cuts), list(decision.abstained), place, before=False)
        self._tracker.restart(proposals)
        self._staying.choose(self.known.spurs, self._tracker.shown(), rule)
        self._told = self._left_open(self._tracker.points())
        return m.Answer(ok=True, reason=f"{len(proposals)} points by the new rule")

    def _left_open(self, points: tuple[m.PruningPoint, ...]) -> tuple[m.Abstention, ...]:
        return self._open.told({SpurNumber(point.vine, point.spur) for point in points})

    def _take(self, tracked: Tracked) -> None:
        self.withdrawn = tracked.withdrawn
        for place in tracked.severed:
            self.known.sever(place)

    def _tell_obstacles(
        self, view: View, labels: NDArray[np.uint8], rods: tuple[Capsule, ...], numbers: tuple[SpurNumber, ...]
    ) -> None:
        """Rods, and of the canes that stay the nearest; `numbers` are the spurs that this frame has shown."""
        config = self._config.obstacles
        if not config.canes:
            self.obstacles = rods
            return
        seen = [spur for spur in self.known.spurs if spur.number in numbers]
        room = max(0, config.most - len(rods))
        told = (*rods, *self._staying.update(view, labels, seen, self._tracker.shown(), self._config.rule, room))
        # The same object as before where nothing is new.
        self.obstacles = self.obstacles if told == self.obstacles else told

    def _is_survey(self, view: View, labels: NDArray[np.uint8]) -> bool:
        """Whether the frame looks at the cordon from where spurs can be read as a whole."""
        depth = view.depth[labels == _CORDON]
        depth = depth[depth > 0.0]
        if len(depth) < _LEAST_CORDON:
            return False
        config = self._config
        return bool(config.survey_nearest <= np.median(depth) <= config.survey_farthest)

    def _no_survey(self) -> MoreToSee:
        near, far = self._config.survey_nearest, self._config.survey_farthest
        return MoreToSee(
            f"no cordon is seen {near:g} to {far:g} m away: go there, or is the camera covered, or its depth missing "
            "or in another unit?"
        )

    def _message(
        self,
        view: View,
        points: tuple[m.PruningPoint, ...],
        abstained: tuple[m.Abstention, ...],
        canes: tuple[tuple[m.Vector3, ...], ...],
    ) -> m.PruningPoints:
        self._told = abstained
        return m.PruningPoints(
            header=m.Header(view.stamp, "odom"),
            segmenter=self.segmenter.name,
            frames=self._frames,
            points=self._explained(points),
            abstained=self._told,
            canes=canes,
            rule=self._rule,
        )


def with_widening(config: PerceptionConfig, widening: float) -> PerceptionConfig:
    """The configuration for a segmenter that draws canes so much too wide (px)."""
    return replace(config, skeleton=replace(config.skeleton, widening=widening))


def _crop_message(point: m.PruningPoint, crop: Crop) -> PointCrop:
    return PointCrop(point_id=point.point_id, revision=point.revision, sequence=crop.sequence, jpeg=crop.jpeg)


def perceive(view: View, labels: "np.ndarray[tuple[int, ...], np.dtype[np.uint8]]", config: PerceptionConfig) -> Plant:
    """One frame to spurs and canes, without memory.

    Args:
        view: The frame.
        labels: H×W class indices.
        config: Section `[perception]`.
    """
    view = mended(view, labels, config.skeleton)
    wood = find_wood(view, labels, config.skeleton)
    fragments = find_fragments(wood, view.depth.shape, config.skeleton)
    seen = np.zeros(view.depth.shape, dtype=bool)
    seen[wood.rows, wood.cols] = True
    chains = link(view, fragments, seen, config.skeleton)
    lines = centrelines(view, wood, chains, config.skeleton)
    return build_plant(view, labels, lines, config.skeleton)


def _vector(place: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> m.Vector3:
    x, y, z = place.tolist()
    return x, y, z
