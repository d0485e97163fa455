import numpy as np
import pinocchio as pin

from benchmarks.kinematic_robot import KinematicRobot
from controller.config import ControllerConfig
from controller.core import Controller
from controller.interface import Sample
from controller.surroundings import Surroundings
from controller.whole_body.collision import CollisionModel
from rolling_panda import intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.robot_model import RobotModel, pose_message
from rolling_panda.row_messages import Capsule, Obstacles
from rolling_panda.teleop_messages import TeleopTarget

CONFIG = ControllerConfig()
HOME = np.concatenate([np.zeros(5), CONFIG.home])


def told(*capsules: Capsule) -> Sample[Obstacles]:
    return Sample(Obstacles(header=m.Header(0.0, "odom"), capsules=capsules), 0.0)


def post(x: float, y: float, radius: float = 0.04) -> Capsule:
    return Capsule("post", (x, y, 0.0), (x, y, 1.9), radius, radius)


def test_what_perception_tells_is_what_distances_are_kept_to() -> None:
    around = Surroundings(CollisionModel(RobotModel()))
    free = around.model.least(HOME).distance
    around.take(told(post(0.5, 0.25)))
    near = around.model.least(HOME)
    assert near.distance < free and any("post" in side for side in near.pair)
    around.take(told())
    assert around.model.least(HOME).distance == free


def test_a_post_in_the_way_of_the_held_tool_is_not_met() -> None:
    """The tool is led straight through a post; it stops before it, and the reason names it."""
    robot = KinematicRobot(Controller(CONFIG, RobotConfig()), CONFIG.home)
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
    judge.take(told(*robot.obstacles))
    least, said = 1.0, set()
    for _ in range(500):
        robot.step()
        said.add(robot.state.reason)
        least = min(least, judge.model.least(robot.q).distance)
    assert robot.state is not None and robot.state.mode == "TELEOP", robot.events
    moved = robot.model.kinematics(robot.q).T_odom_tool.translation - tool.translation
    assert np.linalg.norm(moved) > 0.1
    assert least > 0.0, "it came near, and touched nothing"
    assert "post" in robot.state.reason and "holds the tool back" in robot.state.reason, said
    # Taken back, nothing holds it, and nothing says so.
    robot.teleop = TeleopTarget(sequence=2, hold=True, user="ada", target=pose_message(tool))
    for _ in range(100):
        robot.step()
    assert robot.state.mode == "TELEOP" and "holds" not in robot.state.reason
