import msgspec
import numpy as np
import pinocchio as pin
import pytest

from controller.config import ControllerConfig
from controller.core import Controller
from controller.motion.surroundings import Surroundings, WorkPlace
from controller.whole_body.collision import CollisionModel
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule, Obstacles
from rolling_panda.messages.supervision import TeleopTarget
from rolling_panda.model.robot import RobotModel, pose_message
from rolling_panda.reasons import text_of
from rolling_panda.transport.inbox import Received
from tests.support.controller_config import controller_config
from tests.support.worlds.kinematic_robot import KinematicRobot

CONFIG = ControllerConfig()
HOME = np.concatenate([np.zeros(5), CONFIG.work.home])


def told(*capsules: Capsule) -> Received[Obstacles]:
    return Received(Obstacles(header=m.Header(0.0, "odom"), capsules=capsules), 0.0)


def post(x: float, y: float, radius: float = 0.04) -> Capsule:
    return Capsule("post", (x, y, 0.0), (x, y, 1.9), radius, radius)


def test_what_perception_tells_is_what_distances_are_kept_to() -> None:
    around = Surroundings(CollisionModel(RobotModel()))
    free = around.model.least(HOME).distance
    around.update(told(post(0.5, 0.25)))
    near = around.model.least(HOME)
    assert near.distance < free and any("post" in side for side in near.pair)
    around.update(told())
    assert around.model.least(HOME).distance == free


def cane(x: float, vine: int = 1, spur: int = 2, low: float = 0.9, high: float = 1.2) -> Capsule:
    return Capsule("cane", (x, 0.0, low), (x, 0.0, high), 0.004, 0.004, vine, spur)


def at(*position: float, removes: tuple[int, int] | None = None) -> WorkPlace:
    return WorkPlace(np.array(position), removes)


def parts_near(around: Surroundings, q: np.ndarray, name: str) -> set[str]:
    return {a for a, b in around.model.distances(q, 2.0).pairs if b == name}


def test_the_blades_may_touch_the_spur_that_is_cut_and_nothing_else_may() -> None:
    around = Surroundings(CollisionModel(RobotModel()))
    first, second = "cane 0, vine 1, spur 2", "cane 2, vine 1, spur 3"
    around.update(told(cane(1.0), post(1.0, 0.5), cane(1.04, spur=3), cane(1.0, low=1.2, high=1.3)))
    everything = parts_near(around, HOME, first)
    assert {"blades", "cutter", "camera", "link5", "base"} <= everything
    around.work_at((at(1.0, 0.0, 1.22),))
    assert parts_near(around, HOME, first) == everything - {"blades"}
    assert parts_near(around, HOME, "cane 3, vine 1, spur 2") == everything - {"blades"}, "all of the spur"
    assert "blades" in parts_near(around, HOME, second) and "blades" in parts_near(around, HOME, "post 1")
    around.work_at((at(1.0, 0.0, 1.22), at(1.04, 0.0, 1.22)))
    assert "blades" not in parts_near(around, HOME, first) | parts_near(around, HOME, second)
    around.work_at(())
    assert "blades" in parts_near(around, HOME, first)


def test_what_is_cut_stays_known_when_canes_are_told_anew_under_other_numbers() -> None:
    around = Surroundings(CollisionModel(RobotModel()))
    around.work_at((at(1.0, 0.0, 1.22),))
    around.update(told(cane(1.0)))
    assert "blades" not in parts_near(around, HOME, "cane 0, vine 1, spur 2")
    around.update(told(cane(2.0, spur=5), cane(1.0)))
    assert "blades" in parts_near(around, HOME, "cane 0, vine 1, spur 5")
    assert "blades" not in parts_near(around, HOME, "cane 1, vine 1, spur 2")


def test_beside_a_cut_the_blades_may_push_aside_what_may_yet_be_cut_off() -> None:
    around = Surroundings(CollisionModel(RobotModel()))
    open_choice = [msgspec.structs.replace(cane(x, spur=spur), undecided=True) for x, spur in ((1.02, 3), (1.08, 4))]
    around.update(told(cane(1.0), *open_choice))
    beside, away = "cane 1, vine 1, spur 3", "cane 2, vine 1, spur 4"
    assert "blades" in parts_near(around, HOME, beside)
    around.work_at((at(1.0, 0.0, 1.22),))
    assert "blades" not in parts_near(around, HOME, beside) and "cutter" in parts_near(around, HOME, beside)
    assert "blades" in parts_near(around, HOME, away)


def test_a_cut_far_from_every_cane_exempts_none() -> None:
    around = Surroundings(CollisionModel(RobotModel()))
    around.update(told(cane(1.0)))
    around.work_at((at(1.06, 0.0, 1.0),))
    assert "blades" in parts_near(around, HOME, "cane 0, vine 1, spur 2")


def old_cane(start: float, end: float, vine: int = 1, spur: int = 2) -> Capsule:
    return Capsule("cordon", (start, 0.0, 0.9), (end, 0.0, 0.9), 0.007, 0.007, vine, spur)


def test_only_the_piece_of_last_years_cane_that_is_removed_may_be_touched_and_by_the_blades_alone() -> None:
    around = Surroundings(CollisionModel(RobotModel()))
    pieces = [old_cane(1.0, 1.16), old_cane(1.16, 1.3), old_cane(1.0, 1.16, vine=2), old_cane(1.0, 1.16, spur=-1)]
    around.update(told(*pieces, cane(1.08, spur=3), cane(1.09), post(1.0, 0.5)))
    first, second = "cordon 0, vine 1, spur 2", "cordon 1, vine 1, spur 2"
    others = (second, "cordon 2, vine 2, spur 2", "cordon 3", "cane 4, vine 1, spur 3", "cane 5, vine 1, spur 2")
    everything = parts_near(around, HOME, first)
    assert {"blades", "cutter", "camera", "link5", "base"} <= everything
    around.work_at((at(1.08, 0.0, 0.9),))
    assert parts_near(around, HOME, first) == everything, "another cut there"
    around.work_at((at(1.08, 0.01, 0.9, removes=(1, 2)),))
    assert parts_near(around, HOME, first) == everything - {"blades"}
    assert all("blades" in parts_near(around, HOME, other) for other in others)
    # Between two pieces both are cut through; beside the cane there is nothing to cut.
    around.work_at((at(1.15, 0.0, 0.9, removes=(1, 2)),))
    assert "blades" not in parts_near(around, HOME, first) | parts_near(around, HOME, second)
    around.work_at((at(1.08, 0.02, 0.9, removes=(1, 2)),))
    assert parts_near(around, HOME, first) == everything


def test_beside_the_removal_of_last_years_cane_the_blades_may_push_aside_what_may_yet_be_cut_off() -> None:
    around = Surroundings(CollisionModel(RobotModel()))
    shoot = msgspec.structs.replace(cane(1.1, spur=3), undecided=True)
    around.update(told(old_cane(1.0, 1.16), shoot))
    around.work_at((at(1.08, 0.0, 0.9, removes=(1, 2)),))
    near = parts_near(around, HOME, "cane 1, vine 1, spur 3")
    assert "blades" not in near and "cutter" in near


@pytest.mark.parametrize("method", ["hierarchy", "nullspace", "decoupled"])
def test_a_post_in_the_way_of_the_held_tool_is_not_met(method: str) -> None:
    """The tool is led straight through a post; it stops before it, and the reason names it."""
    robot = KinematicRobot(
        Controller(controller_config(CONFIG, whole_body__method=method), RobotConfig()), CONFIG.work.home
    )
    tool = robot.model.kinematics(robot.q).T_odom_tool
    ahead = tool.translation + 0.25 * tool.rotation[:, 2]
    robot.obstacles = told(post(float(ahead[0]), float(ahead[1]))).message.capsules
    robot.run(0.3)
    assert robot.ask(intents.Arm(user="ada")).ok
    robot.run(0.05)
    behind = tool.translation + 0.5 * tool.rotation[:, 2]
    target = pose_message(pin.SE3(tool.rotation, behind))
    robot.teleop = TeleopTarget(sequence=1, hold=True, user="ada", target=target)
    judge = Surroundings(CollisionModel(RobotModel()))
    judge.update(told(*robot.obstacles))
    least, said = 1.0, set()
    for _ in range(500):
        robot.step()
        said.add(text_of(robot.state.reason))
        least = min(least, judge.model.least(robot.q).distance)
    assert robot.state is not None and robot.state.mode == "TELEOP", robot.events
    moved = robot.model.kinematics(robot.q).T_odom_tool.translation - tool.translation
    assert np.linalg.norm(moved) > 0.1
    assert least > 0.0, "it came near, and touched nothing"
    assert "post" in robot.state.limited_by, said
    # Taken back, nothing holds it, and nothing says so.
    robot.teleop = TeleopTarget(sequence=2, hold=True, user="ada", target=pose_message(tool))
    for _ in range(100):
        robot.step()
    assert robot.state.mode == "TELEOP" and "holds" not in text_of(robot.state.reason)
