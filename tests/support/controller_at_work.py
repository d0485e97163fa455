"""A controller with a robot that has no mass, put to work on points."""

from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from tests.support.worlds.kinematic_robot import KinematicRobot

CONFIG = ControllerConfig()


def robot(config=CONFIG, **changes):
    r = KinematicRobot(Controller(config, RobotConfig()), config.work.home, dt=1.0 / config.rate_hz, **changes)
    r.every = config.base_every
    return r


def working(shown, **changes):
    """A robot that has been shown points and told to cut them all."""
    r = robot(**changes)
    r.step()
    r.show(shown)
    r.step()
    for intent in (intents.Arm(user="ada"), intents.AcceptAll(user="ada"), intents.Start(user="ada")):
        assert r.ask(intent).ok
    return r


def run_until(r, condition, limit_s):
    while not condition(r.state):
        r.step()
        assert r.now < limit_s, f"still {r.state.mode} {r.state.phase}: {r.state.reason}"


def finish(r, limit_s):
    run_until(r, lambda s: s is not None and s.mode == "AUTO", r.now + 1.0)
    run_until(r, lambda s: s.mode != "AUTO", limit_s)


def entry(r, point_id):
    return next(e for e in r.state.queue if e.point_id == point_id)
