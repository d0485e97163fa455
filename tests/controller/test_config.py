from bridge.config import BridgeConfig
from controller.config import ControllerConfig
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.resources import resource

SIM = resource("assets/config/sim.toml")


def test_the_simulations_configuration_agrees_with_the_defaults():
    assert load_section(SIM, "controller", ControllerConfig) == ControllerConfig()


def test_the_simulation_starts_in_the_survey_posture_also_with_a_configuration_of_one_line():
    assert BridgeConfig().start_arm == ControllerConfig().work.home


def test_postures_are_inside_the_arms_limits():
    limits = RobotModel(load_section(SIM, "robot", RobotConfig)).limits
    config = ControllerConfig()
    for posture in (config.work.home, config.work.reach):
        assert (limits.lower[ARM_Q] + 0.2 < posture).all()
        assert (limits.upper[ARM_Q] - 0.2 > posture).all()
