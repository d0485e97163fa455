"""Camera frames in, pruning points out."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from perception.config import PerceptionConfig, RuleConfig
from perception.obstacles.obstacle_map import ObstacleMap
from perception.plant.cane_lines import cane_lines
from perception.plant.clearance import Rods
from perception.plant.map import PlantMap
from perception.plant.model import Array, Plant, Spur
from perception.plant.numbering import RowNumbers, SpurNumber
from perception.plant.undecided_sites import MoreToSee, OpenPlaces, abstention
from perception.rules.by_hand import moved_by_hand, point_by_hand
from perception.rules.keep_out import as_known, in_view
from perception.rules.registry import apply_rule
from perception.rules.spur import Decision
from perception.segmentation.frame import View, decode_frame
from perception.segmentation.mending import mended
from perception.segmentation.segmenter import Segmenter
from perception.skeleton.centreline import centrelines
from perception.skeleton.fragments import find_fragments, find_wood
from perception.skeleton.linking import link
from perception.skeleton.topology import build_plant
from perception.tracking.close_up import look_closely, no_look
from perception.tracking.crop_cache import Crop, CropCache
from perception.tracking.retained_canes import RetainedCanes
from perception.tracking.sightings import Sightings
from perception.tracking.tracker import Proposal, Tracked, Tracker
from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.messages.commands import (
    AddPoint,
    AddPointInImage,
    MovePoint,
    PlantRequest,
    SetRule,
    TakeRuleBack,
    TryRule,
)
from rolling_panda.messages.perception import Capsule, CloseLook, PointCrop
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.robot import RobotModel

_CORDON = m.WOOD_CLASSES.index("cordon")
#: A point by hand this near to another would be the same cut (m).
_TAKEN = 0.01
#: A shorter vector has no direction.
_SHORTEST = 1e-6
#: Fewer pixels of cordon say nothing about how far the row is.
_LEAST_CORDON = 200
#: A spur this near to the middle of the picture is before the camera (m).
_BEFORE_IT = 0.3
#: So many changes of the rule can be taken back, the last one first.
_MOST_BACK = 20
#: A cut this near to one that was made would be the same, or above it on the same cane (m).
_SAME_CUT = 0.02


@dataclass(frozen=True)
class _BeforeRule:
    """What a change of the rule replaced: the rule and what it had made of the vines, and how many cuts were seen."""

    rule: RuleConfig
    tracker: Tracker
    open: OpenPlaces
    told: tuple[m.Abstention, ...]
    severed: int


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
        self._staying = RetainedCanes(config.obstacles)
        self._album = CropCache()
        self._crops: dict[str, PointCrop] = {}
        self._before: list[_BeforeRule] = []
        self._severed: list[m.Vector3] = []
        """Where wood was found cut."""
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
        self.withdrawn = ()
        if isinstance(request, SetRule):
            return self._set_rule(request)
        if isinstance(request, TryRule):
            return self._try_rule(request)
        if isinstance(request, TakeRuleBack):
            return self._take_rule_back(request)
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
    def left_out(self) -> str:
        """What was taken for posts, trunks, cordons or wires where none can be, counted in words; empty for nothing."""
        counted = sorted(self._map.left_out.items())
        return ", ".join(f"{n} {kind}{'' if n == 1 else 's'} {reason}" for (kind, reason), n in counted)

    @property
    def crops(self) -> tuple[PointCrop, ...]:
        """A picture of every point shown whose spur some image shows, in the order of the points."""
        return tuple(self._crops.values())

    @property
    def _rule(self) -> m.PruningRule:
        return _as_told(self._config.rule)

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
        rule = _with_numbers(self._config.rule, request.rule)
        if rule == self._config.rule:
            return m.Answer(ok=True, reason="this rule is in force already")
        before = _BeforeRule(
            self._config.rule, self._tracker.copy(), copy.deepcopy(self._open), self._told, len(self._severed)
        )
        self._before = [*self._before, before][-_MOST_BACK:]
        self._config = replace(self._config, rule=rule)
        judged = self._judged(rule)
        self._open.clear()
        for number, spur, decision in judged:
            self._open.note(number, bool(decision.cuts), list(decision.abstained), _vector(spur.position), before=False)
        proposals = _proposals(judged)
        self._tracker.restart(proposals)
        self._staying.choose(self.known.spurs, self._tracker.shown(), rule)
        self._told = self._left_open(self._tracker.points())
        return m.Answer(ok=True, reason=f"{len(proposals)} points by the new rule")

    def _try_rule(self, request: TryRule) -> m.Answer:
        """What a rule would change, found on a copy."""
        rule = _with_numbers(self._config.rule, request.rule)
        now = {point.point_id: point.digest for point in self._tracker.points()}
        tried = self._tracker.copy()
        if rule != self._config.rule:
            tried.restart(_proposals(self._judged(rule)))
        then = {point.point_id: point.digest for point in tried.points()}
        effect = m.RuleEffect(
            moved=tuple(name for name in now if name in then and then[name] != now[name]),
            gone=tuple(name for name in now if name not in then),
            added=len(then.keys() - now.keys()),
        )
        return m.Answer(ok=True, reason=f"{len(then)} points by that rule", effect=effect)

    def _take_rule_back(self, request: TakeRuleBack) -> m.Answer:
        if request.rule != self._rule:
            return m.Answer(ok=False, reason="the rule has been changed since; look again")
        if not self._before:
            return m.Answer(ok=False, reason="perception knows of no rule before this one; set it by its numbers")
        before = self._before.pop()
        self._config = replace(self._config, rule=before.rule)
        cut = np.array(self._severed[before.severed :]).reshape(-1, 3)
        self._tracker.return_to(before.tracker, lambda number, place: self._stands(number, place, cut))
        self._open, self._told = before.open, before.told
        self._staying.choose(self.known.spurs, self._tracker.shown(), before.rule)
        return m.Answer(ok=True, reason=f"{len(self._tracker.points())} points by the rule before")

    def _stands(self, number: SpurNumber, place: Array, cut: Array) -> bool:
        """Whether none of some cuts (N×3, m, odom) was made at a place of a spur, or below it on the same cane."""
        for made in cut:
            if float(np.linalg.norm(made - place)) < _SAME_CUT:
                return False
            here, there = self.known.nearest_cane(place), self.known.nearest_cane(made)
            if here is None or there is None or here[0].number != number:
                continue
            if here[1] is there[1] and here[3] >= there[3]:
                return False
        return True

    def _judged(self, rule: RuleConfig) -> list[tuple[SpurNumber, Spur, Decision]]:
        """What a rule says of each spur as all frames have shown it."""
        spurs = {known.number: known.as_spur() for known in self.known.spurs}
        keep_out = as_known(self.obstacles, rule)
        judged = []
        for number, spur in spurs.items():
            beside = [cane.axis for other in spurs.values() if other is not spur for cane in other.canes]
            judged.append((number, spur, apply_rule(spur, rule, np.concatenate([np.zeros((0, 3)), *beside]), keep_out)))
        return judged

    def _left_open(self, points: tuple[m.PruningPoint, ...]) -> tuple[m.Abstention, ...]:
        return self._open.told({SpurNumber(point.vine, point.spur) for point in points})

    def _take(self, tracked: Tracked) -> None:
        self.withdrawn = tracked.withdrawn
        for place in tracked.severed:
            self.known.sever(place)
            self._severed.append(_vector(place))

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


def _as_told(rule: RuleConfig) -> m.PruningRule:
    return m.PruningRule(
        system=rule.system,
        nodes_kept=rule.nodes_kept,
        fruiting_nodes=rule.fruiting_nodes,
        keeper_diameter=rule.keeper_diameter,
        offset=rule.offset,
    )


def _with_numbers(rule: RuleConfig, asked: m.PruningRule) -> RuleConfig:
    return replace(
        rule,
        system=asked.system,
        nodes_kept=asked.nodes_kept,
        fruiting_nodes=asked.fruiting_nodes,
        keeper_diameter=asked.keeper_diameter,
        offset=asked.offset,
    )


def _proposals(judged: Sequence[tuple[SpurNumber, Spur, Decision]]) -> list[Proposal]:
    return [Proposal(cut, number) for number, _, decision in judged for cut in decision.cuts]


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
