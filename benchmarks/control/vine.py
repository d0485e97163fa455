"""`rolling-panda bench vine`: a whole vine, from arriving to leaving, with a played reviewer.

The robot arrives before one edge of a vine, surveys it, waits for the decisions, makes the accepted cuts with their
close-ups, and leaves at the other edge with the arm home. The judge reads the truth in the plant's own frame: what
became of every cut that the vine asks for. Seconds are simulated.
"""

import argparse
import json
import math
import tempfile
import time
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import Figure, quantile, share
from benchmarks.control.cane_touches import CaneTouches
from benchmarks.control.cut_truth import OLD_CANE, WantedCut, true_cut, wanted_cuts
from benchmarks.control.row import check_camera, codes, judged_cuts, named, row_of, sim_config
from benchmarks.control.row_report import Cut
from benchmarks.control.row_stages import STAGES, StageClock
from benchmarks.control.row_supervisor import GONE_S, LOOK_S
from benchmarks.control.row_walk import USER, go_on, place
from benchmarks.control.stops import stops_of
from benchmarks.control.world import calibrated
from benchmarks.peers.rows import PEERS, use_peers
from benchmarks.perception.blocked import Blocker, blocked_by
from benchmarks.perception.judge import nearest_rod
from bridge.sim.robot import trace
from bridge.sim.vineyard.config import GUYOT_ROW, VineyardConfig
from bridge.sim.vineyard.config import PRESETS as CULTIVARS
from bridge.sim.vineyard.row import Row
from bridge.sim.vineyard.truth import staying_rods
from bridge.sim.world.config import PRESETS, WorldConfig
from controller.config import ControllerConfig
from controller.motion.follower import Tracking
from controller.whole_body.registry import METHODS
from perception.segmentation.segmenter import SEGMENTERS
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.commands import SURE
from rolling_panda.config import load_section
from rolling_panda.errors import InputError
from rolling_panda.reasons import old_cane_unseen
from tests.support.worlds.closed_loop import ClosedLoop

Training = Literal["spur", "guyot"]
#: `each`: one press for each cut and each undecided place, in the page's order. `vine`: the whole vine at once, its
#: sure cuts accepted in one press and its places left in another, then the other cuts. `nothing`: nobody decides.
Review = Literal["each", "vine", "nothing"]
Outcome = Literal["right", "wrong", "refused", "undecided", "unseen"]
OUTCOMES: tuple[Outcome, ...] = ("right", "wrong", "refused", "undecided", "unseen")
#: Stages in the order of a vine; only `decisions` are the person's.
VINE_STAGES = ("survey", "decisions", "plan", *STAGES, "leaving")
#: The camera in its survey posture is so far ahead of the base (m).
_CAMERA_AHEAD = 0.5
#: Each press of a command, as Survey or Start, takes a person this long (s).
PRESS_S = 1.0
#: As on the page, no decision sooner after the cut has changed (s); nobody looks at one item for longer (s).
_CHANGED_S, _LONGEST_LOOK_S = 0.7, 15.0
#: Who looks at the pictures of a whole vine looks at each for so long: one fixation of the eye. In pictures of scenes
#: a fixation takes 0.33 s on average (Henderson and Hollingworth 1999, doi:10.1146/annurev.psych.50.1.243).
GLANCE_S = 0.33
#: Fewer cuts and places than this are decided one by one: that takes no more presses.
_AT_ONCE = 4
#: After the last decision the plan settles and is computed; Start is pressed without one after so long (s).
_PLAN_S = 5.0
#: A point is accepted no more often than this; stretches of decisions and work, since work finds more points.
_ACCEPTED_AT_MOST, _ROUNDS = 2, 3
#: Whoever decides more often than this goes in circles.
_DECISIONS_AT_MOST = 200
#: Protective stops in one vine after which a person lets the work go on.
_STOPS_AT_MOST = 4
#: The robot has left when it is nearer to the vine's end than this (m).
_ARRIVED = 0.05
#: Longest survey, and work for each accepted point with what does not depend on them (s).
_SURVEY_LIMIT_S, _POINT_LIMIT_S, _WORK_LIMIT_S = 120.0, 20.0, 60.0
#: An undecided place belongs to the spur whose wood is nearest, within this (m).
_SPUR_NEAR = 0.10
#: Periods between two looks at what touches a cane.
_LOOK_EVERY = 4
#: Vines whose growth conditions do not name.
USUAL = "standard"
#: Whole-body method of the robot.
OURS = "hierarchy"
#: Code of the reason that is told of last year's cane.
_OLD_CANE_UNSEEN = old_cane_unseen().code
#: Wood this near to a point, this far past the cut, still stands (m).
_STANDS, _BEYOND = 0.012, 0.03


@dataclass(frozen=True)
class Place:
    """A cut that the vine asks for, by the truth, and what became of it.

    Attributes:
        spur: Spur on the vine.
        kind: What it is for.
        blocked: What leaves no room for the blades wherever it may be made; empty where there is room.
        outcome: `right` and `wrong` of cuts that were made; `refused` of proposed points that were not cut, `undecided`
            of spurs that perception left to a person, and `unseen` where nothing was told.
        reason: Code of the reason, with those of its causes; empty without one.
    """

    spur: int
    kind: str
    blocked: Blocker
    outcome: Outcome
    reason: str


def condition(
    training: str,
    cultivar: str,
    preset: str,
    review: str,
    decision_s: float,
    method: str = OURS,
    glance_s: float = GLANCE_S,
) -> str:
    """The words for the vines of one condition."""
    vine = training if cultivar == USUAL else f"{training}, {cultivar}"
    robot = "" if method == OURS else f"{method}: "
    look = "" if glance_s == GLANCE_S else f", a look {glance_s:g} s"
    return f"{robot}{vine}, {preset}, {review} {decision_s:g} s{look}"


@dataclass(frozen=True)
class VineRun:
    """One vine from arriving to leaving.

    Attributes:
        seed: Of vine, camera and disturbances.
        training: How the vine is trained.
        preset: Of the world.
        review: How the reviewer decides.
        decision_s: Time of one decision (s).
        stages: Seconds by stage (simulated).
        decisions: Presses that decide about cuts and places, or open a whole vine.
        refusals: Codes of refused acceptances, by point.
        cuts: The accepted points.
        places: The cuts that the vine asks for.
        contacts: Physics steps in which the robot met posts, trunks, cordons or wires.
        self_contacts: Physics steps in which it met itself.
        bites_on_hard: Bites that closed on a wire, post, trunk or cordon.
        canes_touched: Canes that stay, in the part that stays, which other parts than the blades overlapped with.
        ended: Empty where the robot left the vine; else why it did not.
        wall_s: Real time of the run (s).
        glance_s: Look at one of several pictures (s).
        glances: Such looks.
        stops: Protective stops after which a person let the work go on.
        cultivar: How the vine grows: a preset of the vineyard.
        false_stops: Protective stops at which the robot touched nothing, by the truth.
        method: Whole-body method.
        unsure: Accepted points that perception was not sure of; None in files of earlier versions.
    """

    seed: int
    training: Training
    preset: str
    review: Review
    decision_s: float
    stages: dict[str, float]
    decisions: int
    refusals: dict[str, str]
    cuts: tuple[Cut, ...]
    places: tuple[Place, ...]
    contacts: int
    self_contacts: int
    bites_on_hard: int
    canes_touched: dict[str, str]
    ended: str
    wall_s: float
    glance_s: float = GLANCE_S
    glances: int = 0
    stops: int = 0
    cultivar: str = USUAL
    false_stops: int = 0
    method: str = OURS
    unsure: tuple[str, ...] | None = None

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from other runs."""
        grown = self.training, self.preset, self.cultivar, self.seed
        return *grown, self.review, self.decision_s, self.glance_s, self.method

    @property
    def condition(self) -> str:
        """In words what it shares with the other vines of its figures."""
        grown = self.training, self.cultivar, self.preset
        return condition(*grown, self.review, self.decision_s, self.method, self.glance_s)

    def as_the_rule_says(self, with_room: bool = False) -> bool:
        """Whether every cut that the vine asks for was made where it is right, and nothing that stays was cut off.

        Args:
            with_room: Whether cuts that leave no room for the blades are left out.
        """
        asked = (place for place in self.places if not (with_room and place.blocked))
        return all(place.outcome == "right" for place in asked) and not any(cut.harm for cut in self.cuts)

    @property
    def person_s(self) -> float:
        """Seconds of the person, with a press of Survey and one of Start."""
        return self.stages["decisions"] + 2 * PRESS_S

    @property
    def machine_s(self) -> float:
        """Seconds of the machine."""
        return sum(self.stages.values()) - self.stages["decisions"]


# --- the reviewer -----------------------------------------------------------------------------------------------------


@dataclass
class Reviewer:
    """A person at the screen Review who takes every proposal and leaves every undecided place.

    Whoever judges the pictures decides better: nothing is rejected here, so that no error of the program is hidden.

    Attributes:
        loop: The robot.
        seconds: Time of one decision (s).
        review: How they decide.
        glance: Time to look at one of several pictures (s).
        decisions: Presses so far.
        glances: Looks at one of several pictures so far.
        points: Every point that was proposed, as it was last seen.
        accepted: Entries of the accepted points, as they were accepted.
        refusals: Codes of refused acceptances, by point.
        left: Undecided places as they were when they were left; a cut beside one changes its reason.
        unsure: Points that perception was not sure of when they were accepted last.
    """

    loop: ClosedLoop
    seconds: float
    review: Review
    glance: float = GLANCE_S
    decisions: int = 0
    glances: int = 0
    points: dict[str, m.PruningPoint] = field(default_factory=dict)
    accepted: dict[str, m.QueueEntry] = field(default_factory=dict)
    refusals: dict[str, str] = field(default_factory=dict)
    left: list[m.UndecidedSite] = field(default_factory=list)
    unsure: set[str] = field(default_factory=set)
    _asked: Counter[str] = field(default_factory=Counter)

    def decide(self) -> None:
        """Decide about everything that is open, one item after the other along the row."""
        if self.review == "nothing":
            self._look("")
            return
        if self.review == "vine":
            self._decide_at_once()
        last = (0, 0, False, "")
        while self.decisions < _DECISIONS_AT_MOST and (item := self._next(last)) is not None:
            last = item
            vine, spur, is_place, point_id = item
            shown = self._look(point_id)
            self.decisions += 1
            if is_place:
                self._leave(vine, spur)
                continue
            self._asked[point_id] += 1
            if shown is not None:
                self._accept([shown])

    def _decide_at_once(self) -> None:
        """Look at the pictures of a whole vine, one after the other; accept its sure cuts, leave its places.

        A cut that has changed since it was looked at is looked at again, as the page asks.
        """
        sure, places = self._sure(), self._places()
        if len(sure) + len(places) < _AT_ONCE:
            return
        self._press()
        shown: dict[str, m.PruningPoint] = {}
        end = self.loop.now + _LONGEST_LOOK_S
        while self.loop.now < end:
            known = {(each.point_id, each.revision, each.digest) for each in shown.values()}
            unseen = (
                each for each in self._sure().values() if (each.point_id, each.revision, each.digest) not in known
            )
            point = next(unseen, None)
            if point is None:
                break
            self._glance(_CHANGED_S if point.point_id in shown else self.glance)
            shown[point.point_id] = point
        for _ in places:
            self._glance(self.glance)
        if shown:
            self._press()
            self._asked.update(list(shown))
            self._accept(shown.values())
        if places:
            self._press()
            for vine, spur in places:
                self._leave(vine, spur)

    def _press(self) -> None:
        self.loop.run(self.seconds)
        self.decisions += 1

    def _glance(self, seconds: float) -> None:
        self.loop.run(seconds)
        self.glances += 1

    def _accept(self, points: Iterable[m.PruningPoint]) -> None:
        """Accept points as they were shown. Refusals and accepted entries are kept."""
        for shown in points:
            name = shown.point_id
            accept = intents.AcceptPoint(user=USER, point_id=name, revision=shown.revision, digest=shown.digest)
            answer = self.loop.command(accept)
            if not answer.ok:
                self.refusals[name] = codes(answer.reason)
                continue
            self.unsure.discard(name)
            if shown.confidence < SURE:
                self.unsure.add(name)
        self.loop.run(0.1)
        self.accepted |= {entry.point_id: entry for entry in self.loop.queue("ACCEPTED", "UNREACHABLE")}

    def _leave(self, vine: int, spur: int) -> None:
        self.left += [site for site in self._sites() if (site.vine, site.spur) == (vine, spur)]
        self.loop.perception.answer(intents.LeaveSite(user=USER, vine=vine, spur=spur))

    def look_at_unknown(self, row: Row) -> None:
        """Look at the wood of each cut of unknown outcome, and tell."""
        for entry in list(self.loop.queue("UNKNOWN")):
            self.loop.run(self.seconds)
            self.decisions += 1
            point = self.points.get(entry.point_id)
            stands = point is not None and _stands(row, point)
            outcome: Literal["DONE", "FAILED_NOT_CUT"] = "FAILED_NOT_CUT" if stands else "DONE"
            told = intents.ResolvePoint(user=USER, point_id=entry.point_id, outcome=outcome, reason="seen by eye")
            self.loop.command(told)

    def _proposed(self) -> list[m.PruningPoint]:
        """Points that wait for a decision."""
        shown = self.loop.inbox.newest(m.PruningPoints)
        if shown is None:
            return []
        points = shown.message.points
        self.points |= {point.point_id: point for point in points}
        waiting = {entry.point_id for entry in self.loop.queue("PROPOSED")}
        return [
            point for point in points if point.point_id in waiting and self._asked[point.point_id] < _ACCEPTED_AT_MOST
        ]

    def _sure(self) -> dict[str, m.PruningPoint]:
        """Points that perception is sure of."""
        return {point.point_id: point for point in self._proposed() if point.confidence >= SURE}

    def _places(self) -> dict[tuple[int, int], bool]:
        """Undecided places that are still to be left, and whether each can wait for another look."""
        found: dict[tuple[int, int], bool] = {}
        left = {(site.vine, site.spur) for site in self.left}
        for site in self._sites():
            place = site.vine, site.spur
            if site.vine > 0 and site.needs != "nothing" and place not in left:
                found[place] = found.get(place, True) and site.needs != "operator"
        return found

    def _sites(self) -> tuple[m.UndecidedSite, ...]:
        shown = self.loop.inbox.newest(m.PruningPoints)
        return () if shown is None else shown.message.undecided_sites

    def _next(self, last: tuple[int, int, bool, str]) -> tuple[int, int, bool, str] | None:
        """The page's next item after one: vine, spur, whether it is a place without a point, and its point."""
        items = {(point.vine, point.spur, False, point.point_id): False for point in self._proposed()}
        items |= {(vine, spur, True, ""): waits for (vine, spur), waits in self._places().items()}
        # On a round along the row; places that another look may settle come last.
        return min(items, key=lambda item: (items[item], item <= last, item), default=None)

    def _look(self, point_id: str) -> m.PruningPoint | None:
        """Look for as long as a decision takes, and longer where the cut changes; the point as it is then."""
        loop, begin = self.loop, self.loop.now
        revision, end = -1, begin + self.seconds
        point: m.PruningPoint | None = None
        while loop.now < min(end, begin + _LONGEST_LOOK_S):
            loop.run(0.1)
            point = next((each for each in self._proposed() if each.point_id == point_id), None)
            if point is not None and point.revision != revision:
                end = end if revision < 0 else max(end, loop.now + _CHANGED_S)
                revision = point.revision
        return point


def _planned(loop: ClosedLoop) -> bool:
    """Whether the plan of the accepted cuts is valid."""
    return loop.session_plan is not None and loop.session_plan.state == "valid"


def _stands(row: Row, point: m.PruningPoint) -> bool:
    """Whether the wood past a cut still stands."""
    beyond = np.array(point.position) + _BEYOND * np.array(point.tangent)
    return nearest_rod(row, beyond)[0] < _STANDS


# --- one vine ---------------------------------------------------------------------------------------------------------


class Visit:
    """A visit of the robot to one vine, from its one edge to the other.

    Attributes:
        reviewer: Who decides.
        stages: Seconds by stage, without those of the work.
        clock: Seconds of the work by stage.
        stops: Protective stops after which the work went on.
    """

    def __init__(self, loop: ClosedLoop, reviewer: Reviewer, clock: StageClock, length: float) -> None:
        """Before it; `length` is the vine's along the row (m)."""
        self.reviewer, self.clock = reviewer, clock
        self.stages = dict.fromkeys(VINE_STAGES, 0.0)
        self._loop, self._length = loop, length
        self.stops = 0
        self._since = 0.0
        self._works = False

    def note(self, tracking: Tracking) -> None:
        """Take in one control period in which the tool follows a motion."""
        if self._works and self._loop.controller.mode == "AUTO":
            self.clock.note(self._loop, tracking)

    def make(self) -> str:
        """Survey, decide, cut and leave; empty where the robot has left the vine, else why it has not."""
        loop = self._loop
        loop.run(1.0)
        loop.command(intents.Arm(user=USER))
        self._since = loop.now
        surveyed = loop.command(intents.Survey(user=USER, distance=self._length))
        if not surveyed.ok:
            return f"no survey: {codes(surveyed.reason)}"
        loop.run_until(lambda: loop.controller.mode != "AUTO", _SURVEY_LIMIT_S)
        self._spent("survey")
        for _ in range(_ROUNDS):
            decided = self.reviewer.decisions
            self.reviewer.decide()
            self._spent("decisions")
            if self.reviewer.decisions == decided or not any(loop.queue("ACCEPTED", "UNREACHABLE")):
                break
            loop.run_until(lambda: _planned(loop), _PLAN_S)
            self._spent("plan")
            self.work()
            if loop.controller.mode != "READY":
                break
        mode = loop.controller.mode
        if mode != "READY":
            return f"{mode}: {'' if loop.state is None else codes(loop.state.reason)}"
        go_on(loop, self._length - place(loop))
        self._spent("leaving")
        left = self._length - place(loop)
        return "" if left < _ARRIVED else f"stands {left:.2f} m before the vine's end"

    def _spent(self, stage: str) -> None:
        self.stages[stage] += self._loop.now - self._since
        self._since = self._loop.now

    def work(self) -> None:
        """Work until nothing is left, with a person who looks at what is unknown and goes on."""
        loop, clock = self._loop, self.clock
        limit = loop.now + _WORK_LIMIT_S + _POINT_LIMIT_S * sum(1 for _ in loop.queue("ACCEPTED"))
        while loop.now < limit and loop.command(intents.Start(user=USER)).ok:
            clock.begin(loop.now)
            self._works = True
            loop.run_until(lambda: loop.controller.mode != "AUTO", limit - loop.now)
            clock.end(loop.now)
            self._works, self._since = False, loop.now
            if loop.controller.mode == "PROTECTIVE_STOP" and self.stops < _STOPS_AT_MOST:
                self._acknowledge()
            if loop.controller.mode != "PAUSED":
                break
            self.reviewer.look_at_unknown(row_of(loop))
            loop.command(intents.Resume(user=USER))
            loop.run(0.1)
            limit += loop.now - self._since
            self._spent("decisions")
        self._since = loop.now

    def _acknowledge(self) -> None:
        """A person comes, looks, and acknowledges once the cause is gone."""
        loop = self._loop
        loop.run(LOOK_S)
        loop.run_until(lambda: loop.command(intents.Acknowledge(user=USER)).ok, GONE_S)
        loop.run(0.1)
        self.stops += loop.controller.mode == "PAUSED"


def prune_vine(
    seed: int,
    training: Training = "spur",
    preset: str = "calm",
    review: Review = "each",
    decision_s: float = 3.0,
    pictures: float = 2.0,
    segmenter: str = "",
    glance_s: float = GLANCE_S,
    cultivar: str = USUAL,
    method: str = OURS,
) -> VineRun:
    """Arrive, survey, decide, cut, leave, and judge.

    Into a rough world the robot comes calibrated and with its camera checked, and it estimates its place in the row.

    Args:
        seed: Of vine, camera and disturbances.
        training: How the vine is trained.
        preset: Of the world.
        review: How the reviewer decides.
        decision_s: Time of one decision (s).
        pictures: The camera takes a second while the robot moves.
        segmenter: In place of the configured one.
        glance_s: Look at one of several pictures (s).
        cultivar: How the vine grows: a preset of the vineyard.
        method: Whole-body method.

    Raises:
        InputError: There is no such preset.
    """
    if preset not in PRESETS:
        raise InputError(f"no world {preset!r}; known are {', '.join(PRESETS)}")
    if cultivar not in CULTIVARS:
        raise InputError(f"no cultivar {cultivar!r}; known are {', '.join(CULTIVARS)}")
    began, looks = time.perf_counter(), 0

    def watch(loop: ClosedLoop, tracking: Tracking) -> None:
        nonlocal looks
        looks += 1
        if looks % _LOOK_EVERY == 0:
            row = row_of(loop)
            touches.look(loop.configuration(), row.standing(), row.revision)
        visit.note(tracking)

    with tempfile.TemporaryDirectory() as folder:
        path, length, world, settings = Path(folder) / "trace", VineyardConfig().vine_spacing, PRESETS[preset], {}
        if preset != "calm":
            world, settings = calibrated(world), _in_the_field(world)
        settings |= one_vine(training, length, cultivar)
        config = sim_config(Path(folder) / "vine.toml", pictures, world, settings)
        with ClosedLoop(seed, path, config, method, watch, segmenter=segmenter) as loop:
            before = row_of(loop)
            guyot = training == "guyot"
            touches, wanted = CaneTouches(staying_rods(before, guyot)), wanted_cuts(before, guyot)
            clock = StageClock(load_section(config, "controller", ControllerConfig))
            visit = Visit(loop, Reviewer(loop, decision_s, review, glance_s), clock, length)
            if preset != "calm":
                check_camera(loop)
            ended = visit.make()
            ends = {entry.point_id: entry for entry in loop.queue()}
            shown = loop.inbox.newest(m.PruningPoints)
            events = tuple(loop.events)
            sites = *(() if shown is None else shown.message.undecided_sites), *visit.reviewer.left
        record = trace.read(path)
    reviewer = visit.reviewer
    bites = [event for event in record.events if event["event"] == "cut"]
    return VineRun(
        seed=seed,
        training=training,
        preset=preset,
        review=review,
        decision_s=decision_s,
        stages=visit.stages | clock.stages,
        decisions=reviewer.decisions,
        refusals=reviewer.refusals,
        cuts=judged_cuts(method, seed, tuple(reviewer.accepted.values()), ends, wanted, bites, {}),
        places=places(before, wanted, bites, reviewer, ends, sites),
        contacts=int(np.count_nonzero(record.rows["contacts"])),
        self_contacts=int(np.count_nonzero(record.rows["self_contacts"])),
        bites_on_hard=sum(bite["code"] == "blades_on_hard_part" for bite in bites),
        canes_touched=named(touches.touched_staying),
        ended=ended,
        wall_s=time.perf_counter() - began,
        glance_s=glance_s,
        glances=reviewer.glances,
        stops=visit.stops,
        cultivar=cultivar,
        false_stops=sum(stop.false for stop in stops_of(events, record.rows)),
        method=method,
        unsure=tuple(sorted(reviewer.unsure)),
    )


def _in_the_field(world: WorldConfig) -> dict[str, dict[str, object]]:
    """Settings of a robot that works outdoors: inertial sensors, the delay of its pictures, its place in the row."""
    return {
        "bridge": {"inertial": True, "frame_time_offset": world.frame_delay},
        "perception": {"localise": True},
    }


def one_vine(training: Training, length: float, cultivar: str) -> dict[str, dict[str, object]]:
    """Settings of a row of one vine, whose edge is in the middle of the first picture."""
    row: dict[str, object] = {"preset": cultivar, "vines": 1, "first_vine_x": _CAMERA_AHEAD + length / 2}
    if training == "spur":
        return {"vineyard": row}
    beside: dict[str, object] = {"row_distance": GUYOT_ROW.row_distance}
    return {
        "vineyard": {**row, **beside, "training": "guyot"},
        "controller.work": beside,
        "perception.rule": {"system": "guyot"},
    }


def places(
    row: Row,
    wanted: Collection[WantedCut],
    bites: Sequence[dict[str, Any]],
    reviewer: Reviewer,
    ends: dict[str, m.QueueEntry],
    sites: Collection[m.UndecidedSite],
) -> tuple[Place, ...]:
    """What became of every cut that the truth asks for.

    Args:
        row: Before the first cut.
        wanted: Its right cuts.
        bites: Of the trace.
        reviewer: With every point that was proposed, and the accepted ones.
        ends: Entries of the queue at the end.
        sites: Undecided sites at the end of the visit, followed by those that the reviewer left. The last site of a
            spur gives its reason. A site that is left for last year's cane gives the reason of that cane only.
    """
    asked = [(each, each.cut) for each in wanted if each.cut is not None]
    pieces = [piece for bite in bites for piece in bite["severed"]]
    proposed: dict[tuple[int, int, str], list[str]] = {}
    for point in reviewer.points.values() if asked else ():
        rod = nearest_rod(row, np.array(point.position))[1]
        # Last year's cane may be told beside its first shoot, which has a spur's number of its own.
        spur = 0 if point.kind == "removal" else rod.spur
        proposed.setdefault((rod.vine, spur, point.kind), []).append(point.point_id)
    left = [(_spur_at(row, site), codes(site.reason)) for site in sites]
    of_spurs = {spur: reason for spur, reason in left if reason != _OLD_CANE_UNSEEN}
    of_old_canes = of_spurs | {spur: reason for spur, reason in left if reason == _OLD_CANE_UNSEEN}
    out = []
    for each, cut in asked:
        truth = true_cut([each], pieces)
        own = proposed.get((each.vine, each.spur, each.kind), [])
        taken = [point_id for point_id in own if point_id in reviewer.accepted or point_id in reviewer.refusals]
        outcome: Outcome
        if truth.right:
            outcome, reason = "right", ""
        elif truth.right_cane or truth.harm:
            outcome, reason = "wrong", truth.harm
        elif any(point_id in ends and ends[point_id].state == "DONE" for point_id in taken):
            outcome, reason = "wrong", "other wood was cut"
        elif taken:
            outcome, reason = "refused", ", ".join(_why(point_id, reviewer, ends) for point_id in taken)
        elif own:
            outcome, reason = "undecided", "not decided"
        else:
            told = (of_old_canes if each.cane == OLD_CANE else of_spurs).get((each.vine, each.spur))
            outcome, reason = ("unseen", "") if told is None else ("undecided", told)
        out.append(Place(each.spur, each.kind, blocked_by(row, cut), outcome, reason))
    return tuple(out)


def _why(point_id: str, reviewer: Reviewer, ends: dict[str, m.QueueEntry]) -> str:
    """Why a point was not cut: its last reason, or its state without one."""
    if point_id not in reviewer.accepted:
        return reviewer.refusals[point_id]
    end = ends.get(point_id)
    return "no_longer_reported" if end is None else codes(end.reason) or end.state


def _spur_at(row: Row, site: m.UndecidedSite) -> tuple[int, int]:
    """Vine and spur that an undecided place belongs to; (-1, -1) for none."""
    if site.position is None:
        return -1, -1
    at = np.array(site.position)
    away, vine, spur = min(
        ((math.dist(rod.at(1.0)[0], at), rod.vine, rod.spur) for _, rod in row.standing() if rod.kind == "spur"),
        default=(math.inf, -1, -1),
    )
    return (vine, spur) if away < _SPUR_NEAR else (-1, -1)


# --- the figures ------------------------------------------------------------------------------------------------------


def summarise(runs: Sequence[VineRun]) -> dict[str, Figure]:
    """The figures of vines under one condition; nothing to share in is told as None."""
    asked = [place for run in runs for place in run.places]
    possible = [place for place in asked if not place.blocked]
    cuts = [cut for run in runs for cut in run.cuts]
    made = [cut for cut in cuts if cut.right_cane or cut.harm]
    left = [run for run in runs if not run.ended]
    told = [run for run in runs if run.unsure is not None]
    sure = [cut for run in told for cut in run.cuts if cut.point_id not in (run.unsure or ())]
    made_of_sure = [cut for cut in sure if cut.right_cane or cut.harm]
    return {
        **{outcome: share(sum(p.outcome == outcome for p in possible), len(possible)) for outcome in OUTCOMES},
        "blocked": share(len(asked) - len(possible), len(asked)),
        "harmed": share(sum(bool(cut.harm) for cut in cuts), len(cuts)),
        "sure": share(len(sure), sum(len(run.cuts) for run in told)),
        "harmed_of_sure": share(sum(bool(cut.harm) for cut in sure), len(sure)),
        "right_of_sure_made": share(sum(cut.true_right for cut in made_of_sure), len(made_of_sure)),
        "vines_as_the_rule_says": share(sum(run.as_the_rule_says() for run in runs), len(runs)),
        "vines_with_room_as_ruled": share(sum(run.as_the_rule_says(with_room=True) for run in runs), len(runs)),
        "right_of_made": share(sum(cut.true_right for cut in made), len(made)),
        "left_the_vine": share(len(left), len(runs)),
        "vines_with_contact": share(sum(run.contacts + run.self_contacts > 0 for run in runs), len(runs)),
        "vines_with_bite_on_hard": share(sum(run.bites_on_hard > 0 for run in runs), len(runs)),
        "machine_s_median": quantile([run.machine_s for run in left], 0.5),
        "machine_s_most": quantile([run.machine_s for run in left], 1.0),
        "machine_60_s": share(sum(run.machine_s <= 60.0 for run in left), len(left)),
        "person_s_median": quantile([run.person_s for run in left], 0.5),
        "person_10_s": share(sum(run.person_s <= 10.0 for run in left), len(left)),
        "both_s_median": quantile([run.machine_s + run.person_s for run in left], 0.5),
        "decisions_median": quantile([float(run.decisions) for run in runs], 0.5),
        "cuts_asked_median": quantile([float(len(run.places)) for run in runs], 0.5),
    }


def tell(run: VineRun) -> None:
    """Print a vine in one line, and each cut that did not come out right."""
    count = Counter(place.outcome for place in run.places if not place.blocked)
    outcomes = ", ".join(f"{count[outcome]} {outcome}" for outcome in OUTCOMES if count[outcome]) or "no cut asked for"
    harmed = sum(bool(cut.harm) for cut in run.cuts)
    print(
        f"{run.condition}, seed {run.seed}: "
        f"machine {run.machine_s:.0f} s, "
        f"person {run.person_s:.0f} s in {run.decisions} decisions, {run.glances} glances; {outcomes}; "
        f"{harmed} harmed, {run.contacts}+{run.self_contacts} contacts, {run.wall_s:.0f} s of real time"
        + (f"; {run.stops} protective stops" if run.stops else "")
        + (f"; {run.false_stops} false stops" if run.false_stops else "")
        + (f"; not left: {run.ended}" if run.ended else ""),
        flush=True,
    )
    for each in run.places:
        if each.outcome != "right":
            blocked = f" (no room: {each.blocked})" if each.blocked else ""
            print(f"    spur {each.spur}, {each.kind}: {each.outcome} {each.reason}{blocked}", flush=True)


def document(runs: Sequence[VineRun], pictures: float, segmenter: str) -> dict[str, Any]:
    """What is written: the figures by condition, and every vine."""
    groups: dict[str, list[VineRun]] = {}
    for run in runs:
        groups.setdefault(run.condition, []).append(run)
    return {
        "pictures_hz": pictures,
        "segmenter": segmenter,
        "summary": {
            name: {key: asdict(value) for key, value in summarise(own).items()} for name, own in groups.items()
        },
        "stages_s": {
            name: {stage: float(np.mean([run.stages[stage] for run in own])) for stage in VINE_STAGES}
            for name, own in groups.items()
        },
        "results": [asdict(run) for run in runs],
    }


def read(path: Path) -> list[VineRun]:
    """The vines of a file; none where there is no file.

    Raises:
        InputError: It is not what this benchmark writes.
    """
    if not path.exists():
        return []
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))["results"]
        return [
            VineRun(
                **{
                    **row,
                    "cuts": tuple(Cut(**cut) for cut in row["cuts"]),
                    "places": tuple(Place(**place) for place in row["places"]),
                    "unsure": None if row.get("unsure") is None else tuple(row["unsure"]),
                }
            )
            for row in rows
        ]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not what `bench vine --json` writes; give another file") from error


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("vine", __doc__)
    parser.add_argument("--preset", choices=("calm", "field"), default="calm", help="of the world (default: calm)")
    parser.add_argument(
        "--training-system", choices=("spur", "guyot"), default="spur", help="how the vines are (default: spur)"
    )
    parser.add_argument(
        "--cultivar", choices=tuple(CULTIVARS), default=USUAL, help="how the vines grow (default: %(default)s)"
    )
    parser.add_argument(
        "--method",
        choices=(*METHODS, *PEERS),
        default=OURS,
        help="whole-body method (default: %(default)s; pink and mink need `make peers`)",
    )
    parser.add_argument("--seed", type=_count, default=3100, help="of the first vine (default: %(default)s)")
    parser.add_argument("--count", type=_positive, default=30, help="vines (default: %(default)s)")
    parser.add_argument(
        "--review",
        choices=("each", "vine", "nothing"),
        default="each",
        help="decide about each cut, about a whole vine's sure ones at once, or about nothing (default: each)",
    )
    parser.add_argument(
        "--decision", type=_seconds, default=3.0, metavar="SECONDS", help="of one decision (default: 3)"
    )
    parser.add_argument(
        "--glance",
        type=_seconds,
        default=GLANCE_S,
        metavar="SECONDS",
        help="to look at one picture of a whole vine's (default: %(default)s)",
    )
    parser.add_argument(
        "--pictures", type=_seconds, default=2.0, metavar="HZ", help="pictures a second in motion (default: 2)"
    )
    parser.add_argument("--segmenter", default="", choices=SEGMENTERS, help="in place of the configured one")
    words = parser.parse_args(argv)
    use_peers([words.method])
    known = [] if words.json is None else read(words.json)
    runs: list[VineRun] = []
    for seed in range(words.seed, words.seed + words.count):
        grown = words.training_system, words.preset, words.cultivar, seed
        key = (*grown, words.review, words.decision, words.glance, words.method)
        found = next((run for run in known if run.key == key), None)
        if found is None:
            found = prune_vine(
                seed,
                words.training_system,
                words.preset,
                words.review,
                words.decision,
                words.pictures,
                words.segmenter,
                words.glance,
                words.cultivar,
                words.method,
            )
            known.append(found)
            # Many vines take hours: what is done is on disk, and the next run goes on from there.
            write(words.json, document(known, words.pictures, words.segmenter))
        runs.append(found)
        tell(found)
    for name, figure in summarise(runs).items():
        print(_line(name, figure))
    return 0


def _line(name: str, figure: Figure) -> str:
    if figure.value is None:
        return f"{name:24} -"
    return f"{name:24} {figure.value:8.3f}   95 % {figure.low:.3f} to {figure.high:.3f}   n {figure.n}"


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no count; give an integer from 0")
    return int(text)


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: give an integer from 1")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= 60.0:
        raise argparse.ArgumentTypeError(f"{text!r}: give a number above 0, up to 60")
    return value
