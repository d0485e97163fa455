import math

import msgspec
import pytest

from controller.config import SupervisionConfig
from controller.supervision.health import Health, Verdict, cause, check, health
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.messages.perception import Localisation, Obstacles
from rolling_panda.messages.robot import RejectionCount
from rolling_panda.transport.inbox import Inbox
from tests.support.fake_wire import bridge_state, joints

CONFIG = SupervisionConfig()
FULL, ASTRAY = reasons.ledger_failed("the disk is full"), reasons.said("joint 3 does not follow")
TOUCHED = reasons.touched("cutter", "post 3", 40.0)
ALL = frozenset({"bridge", "controller", "perception", "server"})
HEALTHY = Health(0.01, 0.02, 0.05, 0.05, 0.05, ALL, watchdog=False, overruled=False)


def verdict(mode, moving=False, **changes):
    return check(mode, moving, msgspec.structs.replace(HEALTHY, **changes), CONFIG)


@pytest.mark.parametrize("mode", ["IDLE", "READY", "TELEOP", "AUTO", "PAUSED"])
def test_all_is_well(mode):
    assert verdict(mode) is None


@pytest.mark.parametrize("mode", ["AUTO", "TELEOP"])
@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"joints": 0.21}, reasons.joints_stale(0.21, CONFIG.joints_max_age_s)),
        ({"odometry": 0.26}, reasons.odometry_stale(0.26, CONFIG.odometry_max_age_s)),
        ({"bridge": 0.6}, reasons.bridge_stale(0.6, CONFIG.bridge_max_age_s)),
        ({"joints": math.inf}, reasons.nothing_received(topics.JOINTS.name)),
        ({"odometry": math.inf}, reasons.nothing_received(topics.ODOMETRY.name)),
        ({"bridge": math.inf}, reasons.nothing_received(topics.BRIDGE.name)),
        ({"watchdog": True}, reasons.watchdog_holds()),
    ],
)
def test_without_the_robots_own_data_motion_stops_protectively(mode, changes, reason):
    assert verdict(mode, **changes) == Verdict("protect", reason)


@pytest.mark.parametrize(
    ("mode", "changes", "reason"),
    [
        ("TELEOP", {"server": 0.31}, reasons.process_silent("server", 0.31, CONFIG.hold_link_max_age_s)),
        ("AUTO", {"server": 2.01}, reasons.process_silent("server", 2.01, CONFIG.server_max_age_s)),
        ("AUTO", {"server": math.inf}, reasons.process_unheard("server")),
        ("TELEOP", {"present": ALL - {"server"}}, reasons.process_gone("server")),
        ("AUTO", {"present": ALL - {"server"}}, reasons.process_gone("server")),
    ],
)
def test_without_the_server_motion_pauses(mode, changes, reason):
    assert verdict(mode, **changes) == Verdict("pause", reason)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"perception": 1.01}, reasons.process_silent("perception", 1.01, CONFIG.perception_max_age_s)),
        ({"present": ALL - {"perception"}}, reasons.process_gone("perception")),
    ],
)
def test_without_perception_only_automatic_work_pauses(changes, reason):
    assert verdict("AUTO", **changes) == Verdict("pause", reason)
    assert verdict("TELEOP", **changes) is None


def test_work_goes_on_where_the_server_is_too_slow_for_a_hand():
    assert verdict("TELEOP", server=0.5).reason == reasons.process_silent("server", 0.5, CONFIG.hold_link_max_age_s)
    assert verdict("AUTO", server=1.9) is None


def test_a_jitter_of_a_tenth_of_a_second_stops_nothing():
    jitter = {"joints": 0.11, "odometry": 0.12, "bridge": 0.15, "server": 0.15, "perception": 0.6}
    assert verdict("AUTO", **jitter) is None


def test_nothing_is_demanded_of_a_robot_that_does_not_move():
    gone = {"joints": 9.0, "server": 9.0, "present": frozenset()}
    assert verdict("READY", **gone) is None
    assert verdict("READY", moving=True, **gone).action == "protect"


def test_the_most_severe_of_several_counts():
    found = verdict("AUTO", present=frozenset(), joints=1.0, overruled=True)
    assert (found.action, found.reason) == ("fault", reasons.other_controller())
    assert verdict("IDLE", overruled=True) is None
    assert verdict("AUTO", present=frozenset(), joints=1.0).action == "protect"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"ledger": FULL}, FULL),
        ({"overruled": True}, reasons.other_controller()),
        ({"tracking_error": ASTRAY}, ASTRAY),
        ({"unfelt": reasons.touch_unfelt()}, reasons.touch_unfelt()),
        ({"contact": TOUCHED}, TOUCHED),
        ({"joints": 1.0}, reasons.joints_stale(1.0, CONFIG.joints_max_age_s)),
        ({"odometry": 1.0}, reasons.odometry_stale(1.0, CONFIG.odometry_max_age_s)),
        ({"bridge": 1.0}, reasons.bridge_stale(1.0, CONFIG.bridge_max_age_s)),
        ({"watchdog": True}, reasons.watchdog_holds()),
    ],
)
def test_a_stop_or_fault_cannot_be_left_while_its_cause_is_there(changes, reason):
    assert cause(msgspec.structs.replace(HEALTHY, **changes), CONFIG) == reason
    assert cause(HEALTHY, CONFIG) is None
    # These end motion, and are no cause of a stop.
    assert cause(msgspec.structs.replace(HEALTHY, server=9.0, perception=9.0, obstacles=9.0), CONFIG) is None


def test_a_contact_stops_every_motion_and_while_the_robot_goes_back_only_another_cause_does():
    for mode in ("AUTO", "TELEOP"):
        assert verdict(mode, contact=TOUCHED) == Verdict("protect", TOUCHED)
    touched = msgspec.structs.replace(HEALTHY, contact=TOUCHED)
    assert check("READY", True, touched, CONFIG) == Verdict("protect", TOUCHED)
    assert check("READY", False, touched, CONFIG) is None
    assert check("PROTECTIVE_STOP", True, touched, CONFIG) is None
    astray = msgspec.structs.replace(touched, tracking_error=ASTRAY)
    assert check("PROTECTIVE_STOP", True, astray, CONFIG) == Verdict("protect", ASTRAY)


def test_with_an_old_picture_of_what_stands_around_automatic_work_alone_stands_and_pauses_at_last():
    waits = Verdict("wait", reasons.waits_for_picture(CONFIG.obstacles_max_age_s))
    assert verdict("AUTO", obstacles=CONFIG.obstacles_max_age_s - 0.01) is None
    assert verdict("AUTO", obstacles=CONFIG.obstacles_max_age_s + 0.01) == waits
    last = CONFIG.obstacles_max_age_s + CONFIG.picture_wait_s
    assert verdict("AUTO", obstacles=last - 0.01) == waits
    old = verdict("AUTO", obstacles=last + 0.01)
    assert old == Verdict("pause", reasons.obstacles_stale(last + 0.01, CONFIG.obstacles_max_age_s))
    gone = verdict("AUTO", obstacles=6.5, present=ALL - {"perception"})
    assert gone == Verdict("pause", reasons.process_gone("perception")), "nothing to wait for"
    server = verdict("AUTO", obstacles=6.5, server=9.0)
    assert server.action == "pause"
    never = verdict("AUTO", obstacles=math.inf)
    assert never == Verdict("pause", reasons.nothing_received(topics.OBSTACLES.name))
    assert verdict("TELEOP", obstacles=6.5) is None


def test_a_robot_that_is_lost_in_the_row_pauses_automatic_work_alone():
    lost = reasons.lost_in_row(reasons.lost_among_others())
    assert verdict("AUTO", lost=lost) == Verdict("pause", lost)
    assert verdict("TELEOP", lost=lost) is None and verdict("READY", lost=lost) is None
    inbox = Inbox()
    assert health(inbox, False, 0.0).lost is None, "perception that does not tell has nothing against the work"
    for state, reason in (("lost", lost), ("located", None)):
        inbox.put(
            Localisation(
                header=m.Header(1.0, "map"),
                state=state,
                T_map_odom=m.Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
                covariance=(1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4),
                reason=reason,
            ),
            0.0,
        )
        assert health(inbox, False, 0.0).lost == reason


def test_the_age_of_a_picture_is_told_by_its_stamp_however_often_it_is_repeated():
    def seen(stamp, at=100.0):
        measured = msgspec.structs.replace(joints(), header=m.Header(50.0))
        told = Obstacles(header=m.Header(stamp), capsules=())
        inbox = Inbox()
        inbox.put(measured, 100.0)
        inbox.put(told, at)
        return health(inbox, False, 100.0).obstacles

    assert seen(49.0) == 1.0
    assert seen(40.0) == 10.0
    assert seen(60.0) == 10.0, "a stamp from the future is as wrong"
    assert seen(50.0, at=90.0) == 10.0
    assert health(Inbox(), False, 0.0).obstacles == float("inf")


@pytest.mark.parametrize("mode", ["IDLE", "READY", "AUTO"])
def test_without_a_ledger_there_is_a_fault_in_every_mode(mode):
    found = verdict(mode, ledger=FULL)
    assert found == Verdict("fault", FULL)


def test_a_robot_that_does_not_follow_is_stopped_protectively():
    found = verdict("AUTO", tracking_error=ASTRAY)
    assert found == Verdict("protect", ASTRAY)


def test_the_age_of_each_input_is_counted_from_its_arrival_and_what_never_came_is_endless():
    header = m.Header(3.0)
    refused = (
        RejectionCount(topic=topics.MOTION.name, reason=reasons.command_old(), count=4),
        RejectionCount(topic=topics.MOTION.name, reason=reasons.token_foreign(), count=1),
        RejectionCount(topic=topics.CUT.name, reason=reasons.token_foreign(), count=7),
    )
    bridge = msgspec.structs.replace(bridge_state(), header=header, watchdog=True, rejections=refused)
    odometry = m.Odometry(header=header, sequence=1, pose=m.PlanarPose(0.0), linear=0.0, angular=0.0)
    inbox = Inbox()
    inbox.present = ALL
    for message, at in ((joints(), 9.5), (odometry, 9.25), (bridge, 9.0)):
        inbox.put(message, at)
    inbox.put(m.Heartbeat(process="server", sequence=1), 8.5)
    inbox.put(m.Heartbeat(process="perception", sequence=1), 8.0)
    found = health(inbox, True, 10.0, FULL, ASTRAY)
    ages = (found.joints, found.odometry, found.bridge, found.server, found.perception)
    assert ages == (0.5, 0.75, 1.0, 1.5, 2.0)
    assert (found.present, found.watchdog, found.overruled, found.refused) == (ALL, True, True, 5)
    assert (found.ledger, found.tracking_error) == (FULL, ASTRAY)
    nothing = health(Inbox(), False, 10.0)
    ages = (nothing.joints, nothing.odometry, nothing.bridge, nothing.server, nothing.perception)
    assert ages == (float("inf"),) * 5
    assert (nothing.present, nothing.watchdog, nothing.overruled, nothing.refused) == (frozenset(), False, False, 0)
    assert (nothing.ledger, nothing.tracking_error) == (None, None)
