"""One object leads the robot by hand: what it sends and when, and where the gizmos lie meanwhile."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.messages.supervision import BaseVelocity, TeleopTarget
from rolling_panda.messages.types import Role
from rolling_panda.model.robot import RobotModel
from server.auth.sessions import Session
from server.config import ServerConfig
from server.robots.event_log import RobotLog
from server.robots.link import RobotLink
from server.robots.page_view import PageView
from server.robots.teleop import TeleopCommand, Teleoperation
from server.scene.scene import Scene
from server.scene.solids import build_solids
from server.scene.viser_adapter.client_messages import GizmoDragEnd, GizmoUpdate
from tests.server.test_misuse import control
from tests.support.fake_wire import FakeWire, joints, located, odometry

MODEL = RobotModel()
DRIVE = TeleopCommand(base=BaseVelocity(0.1, 0.0))


@pytest.fixture(scope="module")
def scene() -> Iterator[Scene]:
    def nothing(*_: object) -> None:
        return None

    made = Scene(MODEL.model, replace(build_solids(), robot=()), nothing, nothing, nothing, nothing)
    yield made
    made.close()


class Hands:
    """Sessions that lead one robot by hand."""

    def __init__(self, scene: Scene, placed: bool = True) -> None:
        self.wire, self.now, self.elsewhere = FakeWire(), 100.0, ""
        self.link = RobotLink(self.wire)
        self.view = PageView(self.link, MODEL)
        self.ended: list[tuple[str, m.Reason]] = []
        self.notes: list[m.Reason] = []
        self.teleop = Teleoperation(
            ServerConfig(),
            self.link,
            scene,
            self.view,
            RobotLog(1000, lambda reason, now: self.notes.append(reason)),
            lambda session: self.elsewhere,
            lambda owner, reason: self.ended.append((owner, reason)),
            lambda: self.now,
        )
        if placed:
            self.place(0.0)

    def place(self, x: float) -> None:
        """The base stands at x (m)."""
        self.wire.deliver(topics.JOINTS, joints())
        self.wire.deliver(topics.ODOMETRY, odometry(x=x))

    @property
    def tool(self) -> m.Pose:
        found = self.view.tool(self.now)
        assert found is not None
        return found

    @property
    def sent(self) -> list[TeleopTarget]:
        found: list[TeleopTarget] = self.wire.sent[topics.TELEOP.name]
        return found

    def hold(self, session: Session, command: TeleopCommand | None = None) -> m.Reason | None:
        """Hold with a page that has just drawn the robot."""
        self.teleop.view_rendered("page", self.now, self.now)
        return self.teleop.hold(session, self.now, command, "page")

    def drag(self, session: Session, x: float) -> None:
        self.teleop.drag(session, GizmoUpdate(name="/gizmo", wxyz=(1.0, 0.0, 0.0, 0.0), position=(x, 0.5, 0.9)))

    def let_go(self, session: Session) -> None:
        self.teleop.drag(session, GizmoDragEnd(name="/gizmo"))


@pytest.fixture
def hands(scene: Scene) -> Iterator[Hands]:
    made = Hands(scene)
    yield made
    for name in ("ann", "bob"):
        scene.forget(name)
    made.link.close()


def person(name: str, role: Role = "operator") -> Session:
    return Session(name, name, role, 0.0, client=f"{name}-key")


ANN, BOB, VI = person("ann"), person("bob"), person("vi", "viewer")


def test_a_drag_is_sent_at_once_but_not_more_often_than_every_20_ms(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    assert hands.hold(ANN) is None
    for step in range(21):
        hands.drag(ANN, 0.3 + 0.001 * step)
        hands.now += 1 / 128
        hands.hold(ANN)
    assert [target.hold for target in hands.sent] == [True] * len(hands.sent)
    places = [target.target.position[0] for target in hands.sent if target.target]
    assert places == pytest.approx([0.3 + 0.001 * step for step in range(0, 21, 3)]), "three periods are 23 ms"


def test_a_drag_without_a_hold_is_sent_only_with_the_hold_that_follows(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    hands.drag(ANN, 0.4)
    hands.teleop.step(hands.now)
    assert hands.sent == []
    hands.hold(ANN)
    hands.teleop.step(hands.now)
    (target,) = hands.sent
    assert target.target is not None and target.target.position[0] == 0.4


def test_a_drag_while_the_base_is_held_is_not_sent(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    hands.hold(ANN, DRIVE)
    hands.drag(ANN, 0.4)
    assert hands.sent == []
    hands.teleop.step(hands.now)
    assert [target.base for target in hands.sent] == [DRIVE.base]


def test_where_a_drag_ends_after_the_hold_is_forgotten(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    tool = hands.tool
    hands.drag(ANN, 0.4)
    hands.let_go(ANN)
    hands.hold(ANN)
    hands.teleop.step(hands.now)
    assert hands.sent[-1].target == tool


def test_the_gizmo_is_in_the_row_and_its_target_where_odom_has_drifted_to(hands: Hands) -> None:
    drift = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.1])), np.array([0.3, -0.05, 0.02]))
    hands.wire.deliver(topics.LOCALISATION, located(drift))
    hands.teleop.show_gizmo(ANN)
    hands.hold(ANN)
    hands.drag(ANN, 0.4)
    (target,) = hands.sent
    assert target.target is not None
    assert target.target.position == pytest.approx(drift.actInv(np.array([0.4, 0.5, 0.9])))
    hands.now += 0.1
    hands.hold(ANN)
    hands.teleop.step(hands.now)
    assert hands.sent[-1].target == target.target


def test_the_end_of_a_drag_while_holding_changes_nothing(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    hands.hold(ANN)
    hands.drag(ANN, 0.4)
    hands.let_go(ANN)
    hands.teleop.step(hands.now)
    target = hands.sent[-1].target
    assert target is not None and target.position[0] == 0.4


def test_a_held_gizmo_stays_where_it_is_and_others_follow_the_tool(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    hands.teleop.show_gizmo(BOB)
    before = hands.tool
    hands.hold(ANN)
    hands.place(0.3)
    hands.teleop.follow_tool(hands.now)
    hands.hold(ANN)
    hands.teleop.step(hands.now)
    assert hands.sent[-1].target == before
    hands.teleop.release(ANN)
    hands.hold(BOB)
    hands.teleop.step(hands.now)
    assert hands.sent[-1].target == hands.tool != before


def test_a_stop_ends_the_hold_with_its_cause(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    hands.hold(ANN)
    hands.teleop.stopped()
    assert hands.teleop.holder is None
    assert hands.ended == [("ann", reasons.hold_stopped())]
    for _ in range(8):
        hands.teleop.step(hands.now)
    assert [target.hold for target in hands.sent] == [False] * 5
    hands.teleop.stopped()
    assert len(hands.ended) == 1, "nobody holds any more"


def test_a_lapse_returns_the_gizmo_and_is_noted_once(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    hands.hold(ANN)
    hands.drag(ANN, 0.4)
    hands.now += 0.16
    hands.teleop.step(hands.now)
    hands.teleop.step(hands.now)
    assert [target.hold for target in hands.sent] == [True, False, False]
    assert hands.notes == [reasons.hold_began("ann"), reasons.hold_lapsed()]
    assert not hands.teleop.must_release(ANN, hands.now)
    hands.hold(ANN)
    hands.teleop.step(hands.now)
    assert hands.sent[-1].target == hands.tool, "a hold that lapsed goes on from the tool"
    hands.now += 2.0
    assert hands.teleop.must_release(ANN, hands.now)


def test_a_release_is_sent_at_once_and_noted(hands: Hands) -> None:
    hands.hold(ANN, DRIVE)
    hands.teleop.release(ANN)
    assert [target.hold for target in hands.sent] == [False]
    assert hands.ended == [("ann", reasons.hold_ended_elsewhere())]
    assert hands.notes == [reasons.hold_began("ann"), reasons.hold_released("ann")]
    hands.teleop.release(ANN)
    assert len(hands.notes) == 2


def test_each_new_refusal_is_noted_once(hands: Hands) -> None:
    hands.hold(ANN, DRIVE)
    del hands.notes[:]
    held = reasons.held_by_other("ann")
    assert [hands.hold(BOB, DRIVE) for _ in range(3)] == [held] * 3
    assert hands.notes == [reasons.hold_refused("bob", held)]
    hands.elsewhere = "panda-2"
    hands.hold(BOB, DRIVE)
    hands.elsewhere = ""
    hands.hold(BOB, DRIVE)
    other = reasons.hold_refused("bob", reasons.other_robot_held("panda-2"))
    assert hands.notes[1:] == [other, reasons.hold_refused("bob", held)]
    hands.teleop.release(BOB)
    hands.hold(BOB, DRIVE)
    assert len(hands.notes) == 4, "let go and pressed anew"
    hands.teleop.release(ANN)
    hands.hold(BOB, DRIVE)
    hands.elsewhere = "panda-2"
    hands.hold(BOB, DRIVE)
    hands.elsewhere = ""
    hands.hold(BOB, DRIVE)
    hands.elsewhere = "panda-2"
    hands.hold(BOB, DRIVE)
    assert hands.notes.count(other) == 3, "each after a hold that was granted"


@pytest.mark.parametrize(
    ("session", "code", "state"),
    [
        (VI, "viewer_only", {}),
        (BOB, "control_held", {"holder": "ann-key"}),
        (BOB, "other_robot_held", {"elsewhere": "panda-2"}),
    ],
)
def test_who_may_not_move_the_robot_is_told_why(
    hands: Hands, session: Session, code: str, state: dict[str, str]
) -> None:
    if "holder" in state:
        hands.wire.deliver(topics.CONTROL, control(state["holder"]))
    hands.elsewhere = state.get("elsewhere", "")
    refused = hands.hold(session, DRIVE)
    assert refused is not None and refused.code == code
    assert hands.teleop.holder is None
    hands.teleop.step(hands.now)
    assert hands.sent == []


def test_a_gizmo_is_refused_to_a_viewer_and_where_the_tool_is_not_known(hands: Hands, scene: Scene) -> None:
    hands.teleop.show_gizmo(VI)
    assert hands.notes == [reasons.gizmo_refused("vi", reasons.viewer_only())]
    unplaced = Hands(scene, placed=False)
    unplaced.teleop.show_gizmo(ANN)
    unplaced.link.close()
    assert unplaced.notes == [reasons.gizmo_refused("ann", reasons.tool_unknown())]
    assert not scene.gizmos.shown("vi") and not scene.gizmos.shown("ann")


def test_a_hidden_gizmo_ends_the_hold_and_its_pose_is_forgotten(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    hands.hold(ANN)
    hands.teleop.hide_gizmo(ANN)
    assert hands.teleop.holder is None
    refused = hands.hold(ANN)
    assert refused == reasons.hold_without_target()


def test_a_session_that_ends_leaves_no_target(hands: Hands) -> None:
    hands.hold(ANN, DRIVE)
    hands.hold(BOB, DRIVE)
    for session in (ANN, BOB):
        hands.teleop.forget(session)
        assert hands.teleop.holder is None
        assert hands.hold(session) == reasons.hold_without_target()


def test_a_script_keeps_its_last_command_and_a_page_takes_its_gizmo(hands: Hands) -> None:
    hands.teleop.show_gizmo(ANN)
    hands.teleop.view_rendered("ann", hands.now, hands.now)
    for command, base in ((None, None), (DRIVE, DRIVE.base), (None, DRIVE.base)):
        assert hands.teleop.hold(ANN, hands.now, command) is None
        hands.teleop.step(hands.now)
        assert hands.sent[-1].base == base
    hands.hold(ANN)
    hands.teleop.step(hands.now)
    assert (hands.sent[-1].base, hands.sent[-1].target) == (None, hands.tool)
