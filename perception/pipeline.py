"""Camera frames in, pruning points out."""

import copy
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec.structs import replace

from perception.arrays import Array, Labels, distance
from perception.calibration.camera import CameraCalibration, Keep, keep_nothing
from perception.calibration.robot import RobotCalibrator
from perception.config import PerceptionConfig, RuleConfig
from perception.localisation.row_frame import RowFrame
from perception.obstacles.cylinder_fit import Rejection
from perception.obstacles.obstacle_map import ObstacleMap
from perception.plant.capsules import CapsuleSet, permanent
from perception.plant.map import PlantMap
from perception.plant.model import Plant, Spur
from perception.plant.numbering import SpurNumber, SpurNumbering
from perception.plant.undecided_sites import BESIDE_CANES, UndecidedSites, undecided_site
from perception.rules.keep_out import frame_keep_out, map_keep_out
from perception.rules.manual import move_cut, place_cut
from perception.rules.pruning import Cut, Decision, apply_rule
from perception.segmentation.frame import CORDON, UnusablePictureError, View, decode_frame
from perception.segmentation.network_segmenter import NetworkSegmenter
from perception.segmentation.segmenter import Segmenter
from perception.skeleton.topology import perceive_plant, trace_canes, trace_old_canes
from perception.tracking.camera_rays import CameraRays, Ray
from perception.tracking.close_up import AROUND, check_close_up, failed_check
from perception.tracking.cut_sight import CutFollower, unseen
from perception.tracking.old_canes import OldCanes, at_heads, beside_spurs
from perception.tracking.picture_shift import UNSHIFTED
from perception.tracking.retained_canes import RetainedCanes
from perception.tracking.spur_pictures import SpurPictures
from perception.tracking.tracker import Proposal, Site, Tracker, TrackerUpdate
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import (
    AddPoint,
    AddPointInImage,
    EvaluateRule,
    LeaveSite,
    MovePoint,
    PlantRequest,
    SetRule,
    UndoRule,
    UseCamera,
)
from rolling_panda.messages.perception import (
    ARM,
    BASE,
    CALIBRATION,
    CHECK,
    ON_THE_WAY,
    CameraMount,
    Capsule,
    CloseUpResult,
    CutSight,
    Localisation,
    RobotCalibration,
    SpurPicture,
)
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import vector3

#: A point by hand nearer than this to another one is the same cut (m).
_DUPLICATE = 0.01
#: Shorter vectors have no direction.
_MIN_NORM = 1e-6
#: Least cordon pixels of a survey frame.
_MIN_CORDON = 200
#: A spur within this distance of the image centre, along the row, is in front of the camera (m).
_IN_FRONT = 0.3
#: Arc length of a cane beyond which what continues it is no spur (m).
_ABOVE_SPUR = 0.04
#: Canes of spurs within this distance of the camera may be in a survey frame (m).
_CANES_NEAR = 2.0
#: Successive unfamiliar frames after which the page says so: a single one would make the list of open places flicker.
_UNFAMILIAR_FRAMES = 2
#: Up to this arc length canes are to be seen, by training system (m).
_REACH = {"spur": 0.2, "guyot": 0.9}
_OLD_CANE_UNSEEN = reasons.old_cane_unseen()
#: Rule changes that can be undone.
_MAX_UNDO = 20
#: A position nearer than this to a cut that was made has been cut (m).
_SAME_CUT = 0.02
_REJECTED: dict[Rejection, Callable[[float, str], m.Reason]] = {
    "off the row": reasons.wood_off_row,
    "that another one is": reasons.wood_there_twice,
    "above the cordon": reasons.wood_above_cordon,
    "leaning": reasons.wood_leaning,
    "lying": reasons.wood_lying,
    "too thick": reasons.wood_too_thick,
    "hardly seen": reasons.wood_hardly_seen,
}


@dataclass(frozen=True)
class _RuleSnapshot:
    """State before a change of the rule; `severed` is the number of cuts seen by then."""

    rule: RuleConfig
    tracker: Tracker
    undecided: UndecidedSites
    undecided_sites: tuple[m.UndecidedSite, ...]
    severed: int


class Perception:
    """The perception pipeline. It has no clock and no thread: the same frames give the same points."""

    def __init__(
        self,
        config: PerceptionConfig,
        segmenter: Segmenter,
        model: RobotModel | None = None,
        mount: CameraMount | None = None,
        keep: Keep = keep_nothing,
    ) -> None:
        """Start with an unknown row.

        Args:
            config: Section `[perception]`.
            segmenter: Semantic segmentation.
            model: The robot, for the camera pose. It is changed: do not share it.
            mount: Calibration of the camera; None takes it to be where it is drawn.
            keep: Keeps a new calibration beyond a restart.
        """
        self._config = with_width_bias(config, segmenter.width_bias)
        self.segmenter = segmenter
        self._model = model or RobotModel()
        self.camera = CameraCalibration(self._model, mount, keep)
        self.calibrator = RobotCalibrator(self._model)
        self._tracker = Tracker(config.tracker)
        self._numbering = SpurNumbering(config.tracker.spur_separation, config.tracker.vine_spacing)
        self._frames = 0
        self._unfamiliar_frames = 0
        """Unfamiliar frames in succession, up to now."""
        self._stamp = 0.0
        self._undecided = UndecidedSites()
        self._site_messages: tuple[m.UndecidedSite, ...] = ()
        self._cane_lines: tuple[tuple[m.Vector3, ...], ...] = ()
        self._obstacle_map = ObstacleMap(config.obstacles)
        self._retained_canes = RetainedCanes(config.obstacles)
        self._old_canes = OldCanes()
        self._spur_pictures = SpurPictures()
        self.pictures: tuple[SpurPicture, ...] = ()
        """Pictures of the spurs with a published point, and of the undecided ones."""
        self._follower = CutFollower(config)
        self._shifts: dict[str, Array] = {}
        """By how much the last close-up that showed a point was shifted against the map (m), by point."""
        self._undo: list[_RuleSnapshot] = []
        self._severed: list[Cut] = []
        """Cuts that were found made."""
        self.camera_rays = CameraRays()
        self.plant_map = PlantMap()
        self.withdrawn: tuple[m.Reason, ...] = ()
        """Points withdrawn by the last frame, with the reasons."""
        self._wood: tuple[Capsule, ...] = ()
        """Obstacle map with the retained canes, in map."""
        self.row_frame = RowFrame(config.localise)
        self._handlers: dict[type[PlantRequest], Callable[[Any], m.Answer]] = {
            SetRule: self._set_rule,
            EvaluateRule: self._try_rule,
            UndoRule: self._undo_rule,
            MovePoint: self._move,
            AddPoint: self._add,
            AddPointInImage: self._add_in_image,
            UseCamera: self._use_camera,
            LeaveSite: self._leave_site,
        }

    def process(self, frame: CameraFrame) -> m.PruningPoints:
        """Process one frame; returns all points.

        Args:
            frame: As received.

        Raises:
            CorruptFrameError: The frame is corrupt; nothing changes.
        """
        view = decode_frame(frame, self._model)
        self._stamp = view.stamp
        self.camera_rays.add(frame)
        self.row_frame.predict(_base(frame), view.stamp, _inertial(frame))
        self.withdrawn = ()
        if self.camera.follow(frame.joint_offsets, frame.delay):
            self._forget()
        # The calibration's board hides the row. On the way to a cut other pictures would come too late.
        if frame.point_id.startswith((CALIBRATION, BASE, ARM, ON_THE_WAY)) or -view.R[2, 1] < self._config.min_upright:
            return self.points()
        try:
            labels = self.segmenter.segment(view)
        except UnusablePictureError as error:
            self._site_messages = (undecided_site(error.reason),)
            return replace(self.points(), canes=())
        self._frames += 1
        if (unfamiliar := self.segmenter.unfamiliar) is not None:
            return self._process_unfamiliar(self.row_frame.in_map(view), labels, unfamiliar)
        self._unfamiliar_frames = 0
        if self._is_survey(view, labels):
            plant = perceive_plant(view, labels, self._config.skeleton)
            canes = [cane for spur in plant.spurs for cane in spur.canes]
            self.camera.observe(view, frame, [cane.axis for cane in canes])
            self.row_frame.update(view, labels, canes)
            if self.row_frame.lost is not None:
                return self._process_unfamiliar(self.row_frame.in_map(view), labels, self.row_frame.lost)
            self._survey(self.row_frame.in_map(view), labels, self.row_frame.plant_in_map(plant))
        elif self.row_frame.lost is not None:
            return self._process_unfamiliar(self.row_frame.in_map(view), labels, self.row_frame.lost)
        else:
            # Too near or too far to read whole spurs, but it may show that wood is gone.
            if self.row_frame.uncertain:
                self._locate(view, labels)
            view = self.row_frame.in_map(view)
            cylinders = self._obstacle_map.update(view, labels, apart=self._old_wood(view))
            self._apply(self._tracker.update(view, labels, []))
            self._update_obstacles(view, labels, cylinders, ())
            self._site_messages = (undecided_site(self._no_survey()),)
            if self.plant_map.spurs:
                self._site_messages = self._undecided_sites()
        return self.points()

    def _process_unfamiliar(self, view: View, labels: Labels, reason: m.Reason) -> m.PruningPoints:
        """Points after a frame of doubtful classes or place: it adds obstacles, and removes and proposes nothing."""
        old_wood = self._old_wood(view)
        cylinders = self._obstacle_map.update(view, labels, only_add=True, apart=old_wood)
        canes = tuple(capsule for capsule in self._wood if capsule.kind == "cane")
        wood = (cylinders + old_wood + canes)[: self._config.obstacles.max_capsules]
        self._wood = self._wood if wood == self._wood else wood
        self._unfamiliar_frames += 1
        if self._unfamiliar_frames < _UNFAMILIAR_FRAMES:
            return self.points()
        self._site_messages = (undecided_site(reason),)
        return replace(self.points(), canes=())

    def _survey(self, view: View, labels: Labels, plant: Plant) -> None:
        """Update plant map, points and obstacles from a survey frame and its plant, in map."""
        guyot, along = self._config.rule.system == "guyot", view.R[:, 0]
        if guyot:
            plant = at_heads(plant, [each for each in self._wood if each.kind in ("trunk", "post")], along)
        canes = self.plant_map.canes_above(_ABOVE_SPUR, self._config.tracker.min_hits, view.t, _CANES_NEAR)
        plant, numbers = self._numbering.numbered(plant, along, canes)
        spurs = self.plant_map.update(plant, numbers, _REACH[self._config.rule.system])
        old_canes = trace_old_canes(view, labels, self._config.skeleton) if guyot else []
        old_of = beside_spurs(old_canes, plant, numbers, self._old_canes.newest)
        self._old_canes.see(old_of)
        cylinders = self._obstacle_map.update(view, labels, apart=self._old_wood(view))
        self._spur_pictures.add(view, plant, numbers)
        # Hardly any picture shows all the nodes of a cane that will fruit.
        whole_canes = self._config.fuse or guyot
        fused = {spur.number: spur.as_spur() for spur in self.plant_map.spurs} if whole_canes else {}
        keep_out = frame_keep_out(view, labels, self._wood, self._config.rule)
        decisions: list[tuple[Spur, SpurNumber, Decision]] = []
        contradicted: set[Site] = set()
        for seen, spur, number in zip(plant.spurs, spurs, numbers, strict=True):
            whole, others = fused.get(number, spur), plant.other_canes(seen)
            decision = apply_rule(whole, self._config.rule, others, keep_out, old_of.get(number))
            decisions.append((spur, number, decision))
            contradicted |= {(number, kind) for kind in decision.contradicted}
        self._apply(self._tracker.update(view, labels, _proposals(decisions), numbers, contradicted))
        unconfirmed = self._tracker.unconfirmed()
        for spur, number, decision in decisions:
            aside = abs(float(along @ (spur.position - view.t)))
            self._update_undecided(number, spur, decision, aside < _IN_FRONT, unconfirmed)
        self._update_obstacles(view, labels, cylinders, numbers)
        self._cane_lines = self.plant_map.cane_lines() + self._old_canes.lines()
        self._site_messages = self._undecided_sites()

    def check_close_up(self, frame: CameraFrame) -> CloseUpResult:
        """Check the point of a close-up frame, and refine its position.

        Args:
            frame: As received, with the id of the point.

        Raises:
            CorruptFrameError: The frame is corrupt; nothing changes.
        """
        if frame.point_id.startswith(CALIBRATION):
            return self.camera.look(frame)
        if frame.point_id.startswith((BASE, ARM)):
            result = self.calibrator.look(frame)
            if self.calibrator.mount is not None:
                self.camera.measured_with_arm(self.calibrator.mount)
            return result
        if frame.point_id.startswith(CHECK):
            # The picture itself tells, as one of a survey.
            return CloseUpResult(
                header=m.Header(frame.header.stamp, "odom"),
                point_id=frame.point_id,
                number=frame.number,
                finding="seen",
            )
        point = self._tracker.find(frame.point_id)
        if point is None or not self.camera.fits(frame.joint_offsets):
            return failed_check(frame, reasons.point_unknown_to_perception())
        view = decode_frame(frame, self._model)
        self.row_frame.predict(_base(frame), view.stamp, _inertial(frame))
        try:
            if self.row_frame.uncertain:
                self._locate(view, self.segmenter.segment(view))
            view = self.row_frame.in_map(view)
            known = self.plant_map.around(np.array(point.position), AROUND)
            expected = self._shifts.get(point.point_id, UNSHIFTED)
            check, shift = check_close_up(view, self.segmenter, point, frame.number, self._config, known, expected)
        except UnusablePictureError as error:
            return failed_check(frame, error.reason)
        self._follower.begin(check, point.kind)
        if check.position is not None:
            self._shifts[point.point_id] = shift
            # In the map, which is not shifted with the picture.
            self._tracker.refine(point.point_id, np.array(check.position) - shift)
        return self.row_frame.check_in_odom(check)

    def see_cut(self, frame: CameraFrame) -> CutSight:
        """Find the cut in a picture that was taken on the last way to it; nothing else is looked at, nor changed.

        Args:
            frame: As received, with `ON_THE_WAY` before the id of the point.

        Raises:
            CorruptFrameError: The frame is corrupt; nothing changes.
        """
        point_id = frame.point_id.removeprefix(ON_THE_WAY)
        if not self.camera.fits(frame.joint_offsets):
            self._follower.forget()
        view = self.row_frame.in_map(decode_frame(frame, self._model))
        try:
            sight = self._follower.look(view, self.segmenter, point_id, frame.number)
        except UnusablePictureError as error:
            return unseen(view.stamp, point_id, frame.number, error.reason)
        return self.row_frame.sight_in_odom(sight)

    def _locate(self, view: View, labels: Labels) -> None:
        """Find where the robot is from a frame that is no survey: the base has moved since it was known."""
        lines = trace_canes(view, labels, self._config.skeleton, measured_only=True)
        self.row_frame.update(view, labels, lines, near=True)

    @property
    def config(self) -> PerceptionConfig:
        """Present configuration, with the segmenter's width bias and the newest rule."""
        return self._config

    def answer(self, request: PlantRequest) -> m.Answer:
        """Execute a request of an operator; a refused one changes nothing."""
        self.withdrawn = ()
        handler = self._handlers.get(type(request))
        return _refused(reasons.request_unknown(type(request).__name__)) if handler is None else handler(request)

    def points(self) -> m.PruningPoints:
        """All points, undecided sites and canes; the pictures are brought up to date."""
        points = self._tracker.points()
        sites = [SpurNumber(site.vine, site.spur) for site in self._site_messages if site.vine > 0]
        self.pictures = self._spur_pictures.update(points, sites, self.plant_map, self._old_canes.newest)
        return m.PruningPoints(
            header=m.Header(self._stamp, "map"),
            segmenter=self.segmenter.name,
            frames=self._frames,
            points=self._with_distances(points),
            undecided_sites=self._site_messages,
            canes=self._cane_lines,
            rule=_rule_message(self._config.rule),
        )

    @property
    def obstacles(self) -> tuple[Capsule, ...]:
        """Obstacle map with the retained canes, in map; the same object while there is no news."""
        return self._wood

    @property
    def robot_calibration(self) -> RobotCalibration:
        """What pictures tell of the robot itself."""
        return replace(self.calibrator.state, timing=self.camera.timing)

    @property
    def localisation(self) -> Localisation:
        """Where the robot is in the row."""
        return self.row_frame.message(self._stamp)

    @property
    def familiarity_unknown(self) -> bool:
        """Whether unfamiliar pictures go unnoticed, since the network does not tell them."""
        return isinstance(self.segmenter, NetworkSegmenter) and self.segmenter.familiar is None

    @property
    def rejected_wood(self) -> tuple[m.Reason, ...]:
        """What of posts, trunks, cordons and wires is not among the obstacles, as it is implausible."""
        return tuple(_REJECTED[why](n, kind) for (kind, why), n in sorted(self._obstacle_map.rejected.items()))

    def _with_distances(self, points: tuple[m.PruningPoint, ...]) -> tuple[m.PruningPoint, ...]:
        """The points with their distances to wires and cordons."""
        positions = np.array([point.position for point in points]).reshape(-1, 3)
        wood = permanent(self._wood, self._config.rule)
        wires, cordons = (
            [None if np.isinf(d) else d for d in CapsuleSet(wood, (kind,)).nearest(positions).tolist()]
            for kind in ("wire", "cordon")
        )
        return tuple(
            replace(point, wire_distance=wire, cordon_distance=cordon)
            for point, wire, cordon in zip(points, wires, cordons, strict=True)
        )

    def _use_camera(self, request: UseCamera) -> m.Answer:
        """Use another calibration. What was seen by the old one is forgotten, but for the obstacles."""
        answer = self.camera.use(request.made_at)
        if answer.ok:
            self._forget()
        return answer

    def _forget(self) -> None:
        """Forget all wood but the obstacles: camera or arm have another calibration than it was seen by."""
        self.withdrawn = self._tracker.withdraw_all()
        self.plant_map, self._spur_pictures, self._undecided = PlantMap(), SpurPictures(), UndecidedSites()
        self._undo, self._severed, self._cane_lines, self._site_messages = [], [], (), ()
        self._old_canes, self._shifts = OldCanes(), {}
        self.row_frame.forget()

    def _add(self, request: AddPoint) -> m.Answer:
        ray = Ray(np.array(request.origin), np.array(request.direction))
        return self._place(ray, request.user)

    def _add_in_image(self, request: AddPointInImage) -> m.Answer:
        at = request.sequence, request.u, request.v
        ray = self._spur_pictures.ray(*at)
        if ray is None and (seen := self.camera_rays.ray(*at, self._model)) is not None:
            ray = self.row_frame.ray_in_map(seen)
        return _refused(reasons.picture_too_old()) if ray is None else self._place(ray, request.user)

    def _place(self, ray: Ray, user: str) -> m.Answer:
        length = float(np.linalg.norm(ray.direction))
        if length < _MIN_NORM:
            return _refused(reasons.ray_without_direction())
        found = place_cut(self.plant_map, ray.origin, ray.direction / length, self._config.rule, self._wood, user)
        if isinstance(found, m.Reason):
            return _refused(found)
        for point in self._tracker.points():
            if distance(np.array(point.position), found[0].position) < _DUPLICATE:
                return _refused(reasons.point_there_already(point.point_id, 1000 * _DUPLICATE))
        return _done(reasons.point_placed(self._tracker.add(Proposal(*found)).point_id))

    def _move(self, request: MovePoint) -> m.Answer:
        point = next((each for each in self._tracker.points() if each.point_id == request.point_id), None)
        if point is None:
            return _refused(reasons.point_unseen(request.point_id))
        if point.kind == "renewal cut":
            return _refused(reasons.renewal_cut_fixed())
        if point.kind == "removal":
            return _refused(reasons.removal_fixed())
        position = np.array(point.position)
        cut = move_cut(self.plant_map, position, request.along, self._config.rule, self._wood, request.user)
        if isinstance(cut, m.Reason):
            return _refused(cut)
        return _done(self._tracker.move(request.point_id, cut).reason)

    def _leave_site(self, request: LeaveSite) -> m.Answer:
        if not self._undecided.leave(SpurNumber(request.vine, request.spur), request.left):
            return _refused(reasons.site_unknown(request.vine, request.spur))
        self._site_messages = self._undecided_sites()
        told = reasons.site_left if request.left else reasons.site_reopened
        return _done(told(request.vine, request.spur))

    def _set_rule(self, request: SetRule) -> m.Answer:
        rule = _with_numbers(self._config.rule, request.rule)
        if rule == self._config.rule:
            return _done(reasons.rule_in_force())
        snapshot = _RuleSnapshot(
            self._config.rule,
            self._tracker.copy(),
            copy.deepcopy(self._undecided),
            self._site_messages,
            len(self._severed),
        )
        self._undo = [*self._undo, snapshot][-_MAX_UNDO:]
        self._config = replace(self._config, rule=rule)
        decisions = self._decide(rule)
        proposals = self._by_rule(decisions, rule)
        self._tracker.reset(proposals)
        self._undecided.clear()
        for spur, number, decision in decisions:
            self._update_undecided(number, spur, decision, in_front=False)
        self._retained_canes.select(self.plant_map.spurs, self._tracker.published_cuts(), rule)
        self._site_messages = self._undecided_sites()
        return _done(reasons.points_by_new_rule(len(proposals)))

    def _try_rule(self, request: EvaluateRule) -> m.Answer:
        """The effect of a rule, on a copy."""
        rule = _with_numbers(self._config.rule, request.rule)
        now = {point.point_id: point.digest for point in self._tracker.points()}
        tracker = self._tracker.copy()
        if rule != self._config.rule:
            tracker.reset(self._by_rule(self._decide(rule), rule))
        then = {point.point_id: point.digest for point in tracker.points()}
        effect = m.RuleEffect(
            changed=tuple(name for name in now if name in then and then[name] != now[name]),
            removed=tuple(name for name in now if name not in then),
            added=len(then.keys() - now.keys()),
        )
        return _done(reasons.points_by_that_rule(len(then)), effect)

    def _undo_rule(self, request: UndoRule) -> m.Answer:
        if request.rule != _rule_message(self._config.rule):
            return _refused(reasons.rule_changed_since())
        if not self._undo:
            return _refused(reasons.no_rule_before())
        before = self._undo.pop()
        self._config = replace(self._config, rule=before.rule)
        made = self._severed[before.severed :]
        self._tracker.restore(before.tracker, lambda number, position: self._is_standing(number, position, made))
        self._undecided, self._site_messages = before.undecided, before.undecided_sites
        self._retained_canes.select(self.plant_map.spurs, self._tracker.published_cuts(), before.rule)
        return _done(reasons.points_by_rule_before(len(self._tracker.points())))

    def _is_standing(self, number: SpurNumber, position: Array, cuts: list[Cut]) -> bool:
        """Whether none of some cuts was made at a position of a spur, or below it on the same cane."""
        for cut in cuts:
            if distance(cut.position, position) < _SAME_CUT:
                return False
            if cut.kind == "removal":
                # The map has no last year's cane; the nearest cane is another one.
                continue
            here, there = self.plant_map.nearest_cane(position), self.plant_map.nearest_cane(cut.position)
            if here is None or there is None or here[0].number != number:
                continue
            if here[1] is there[1] and here[3] >= there[3]:
                return False
        return True

    def _decide(self, rule: RuleConfig) -> list[tuple[Spur, SpurNumber, Decision]]:
        """Decisions of a rule for all mapped spurs."""
        spurs = {known.number: known.as_spur() for known in self.plant_map.spurs}
        keep_out = map_keep_out(self._wood, rule)
        decisions = []
        for number, spur in spurs.items():
            axes = [cane.axis for other in spurs.values() if other is not spur for cane in other.canes]
            other_canes = np.concatenate([np.zeros((0, 3)), *axes])
            old_cane = self._old_canes.newest.get(number)
            decisions.append((spur, number, apply_rule(spur, rule, other_canes, keep_out, old_cane)))
        return decisions

    def _by_rule(self, decisions: list[tuple[Spur, SpurNumber, Decision]], rule: RuleConfig) -> list[Proposal]:
        """The cuts of a rule. A removal that has a point stays as it is, as no number of the rule is about it."""
        stay = [each for each in self._tracker.published_cuts() if each.cut.kind == "removal"]
        stay = stay if rule.system == "guyot" else []
        known = {each.number for each in stay}
        other = [each for each in _proposals(decisions) if each.cut.kind != "removal" or each.number not in known]
        return [*stay, *other]

    def _update_undecided(
        self,
        number: SpurNumber,
        spur: Spur,
        decision: Decision,
        in_front: bool,
        unconfirmed: Collection[Site] = (),
    ) -> None:
        causes = [(decision.about(reason), reason) for reason in decision.undecided]
        # One picture may hide what others have shown. Stored, such a reason would be told again once the cut is made.
        settled = {kind for site, kind in self._tracker.settled if site == number}
        causes = [(against, reason) for against, reason in causes if not against or against - settled]
        # A vine has one cane of last year: it may be beside another spur of its head, or cut off.
        removals = {site.vine for site, kind in self._tracker.settled if kind == "removal"}
        if number.vine in removals or self._old_canes.is_severed(number.vine):
            causes = [each for each in causes if each[1] != _OLD_CANE_UNSEEN]
        if any((number, cut.kind) in unconfirmed for cut in decision.cuts):
            causes.append((frozenset(), reasons.cut_unconfirmed()))
        has_cuts = any(cut.kind not in BESIDE_CANES for cut in decision.cuts)
        self._undecided.update(number, has_cuts, causes, vector3(spur.position), in_front)

    def _undecided_sites(self) -> tuple[m.UndecidedSite, ...]:
        return self._undecided.remaining(self._tracker.points())

    def _apply(self, update: TrackerUpdate) -> None:
        self.withdrawn += update.withdrawn
        for cut, number in ((each.cut, each.number) for each in update.severed):
            self._severed.append(cut)
            position = cut.position
            if cut.kind == "removal":
                self._obstacle_map.forget(self._old_canes.sever(number, position))
                continue
            found = self.plant_map.nearest_cane(position)
            if found is not None:
                self._spur_pictures.forget(found[0].number)
            self.plant_map.sever(position)

    def _update_obstacles(
        self, view: View, labels: Labels, cylinders: tuple[Capsule, ...], numbers: tuple[SpurNumber, ...]
    ) -> None:
        """Publish cylinders and the nearest retained canes; `numbers` are the spurs of this frame."""
        config = self._config.obstacles
        obstacles = (cylinders + self._old_wood(view))[: config.max_capsules]
        if config.canes:
            seen = [spur for spur in self.plant_map.spurs if spur.number in numbers]
            room = max(0, config.max_capsules - len(obstacles))
            cuts = self._tracker.published_cuts()
            obstacles += self._retained_canes.update(view, labels, seen, cuts, self._config.rule, room)
        # Without news the object stays the same.
        self._wood = self._wood if obstacles == self._wood else obstacles

    def _old_wood(self, view: View) -> tuple[Capsule, ...]:
        """Last year's canes as obstacles; cordon-trained vines have none."""
        return self._old_canes.capsules(view.t) if self._config.rule.system == "guyot" else ()

    def _is_survey(self, view: View, labels: Labels) -> bool:
        """Whether the cordon is seen from a distance at which whole spurs can be read."""
        depth = view.depth[labels == CORDON]
        depth = depth[depth > 0.0]
        if len(depth) < _MIN_CORDON:
            return False
        return bool(self._config.survey_min_depth <= np.median(depth) <= self._config.survey_max_depth)

    def _no_survey(self) -> m.Reason:
        return reasons.no_cordon_in_range(self._config.survey_min_depth, self._config.survey_max_depth)


def _inertial(frame: CameraFrame) -> bool:
    """Whether inertial sensors have corrected the odometry."""
    return frame.attitude is not None and frame.attitude.measured


def _base(frame: CameraFrame) -> Array:
    return np.array([frame.base.x, frame.base.y, frame.base.phi])


def with_width_bias(config: PerceptionConfig, width_bias: float) -> PerceptionConfig:
    """The configuration for a segmenter with a width bias (px)."""
    return replace(config, skeleton=replace(config.skeleton, width_bias=width_bias))


def _refused(reason: m.Reason) -> m.Answer:
    return m.Answer(ok=False, reason=reason)


def _done(reason: m.Reason, effect: m.RuleEffect | None = None) -> m.Answer:
    return m.Answer(ok=True, reason=reason, effect=effect)


def _rule_message(rule: RuleConfig) -> m.PruningRule:
    return m.PruningRule(**{name: getattr(rule, name) for name in m.PruningRule.__struct_fields__})


def _with_numbers(rule: RuleConfig, request: m.PruningRule) -> RuleConfig:
    return replace(rule, **{name: getattr(request, name) for name in m.PruningRule.__struct_fields__})


def _proposals(decisions: list[tuple[Spur, SpurNumber, Decision]]) -> list[Proposal]:
    return [Proposal(cut, number) for _, number, decision in decisions for cut in decision.cuts]
