from rolling_panda.messages import commands as intents
from rolling_panda.model.robot import ARM_Q
from tests.support.controller_at_work import CONFIG, robot, run_until


def ready():
    r = robot()
    r.q[ARM_Q] = CONFIG.reach
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    run_until(r, lambda s: s is not None and s.mode == "READY", 1.0)
    return r


def test_what_ends_a_mode_ends_what_moved_in_it():
    r = ready()
    assert r.ask(intents.Home(user="ada")).ok
    r.run(0.1)
    assert r.state.reason == "homing the arm"
    r.stop()
    r.run(0.2)
    assert r.state.mode == "ESTOP_LATCHED"
    assert not r.controller._movement.homing


def test_a_lost_server_ends_the_way_home_without_a_change_of_mode():
    r = ready()
    assert r.ask(intents.Home(user="ada")).ok
    r.run(0.1)
    r.server = False
    r.run(3.0)
    assert any("homing was stopped" in text for text in r.events), r.events
    assert not r.controller._movement.homing


def test_an_operator_stops_the_way_home_and_is_named():
    r = ready()
    assert r.ask(intents.Home(user="ada")).ok
    r.run(0.1)
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.1)
    assert r.state.mode == "READY"
    assert "stopped by ada" in r.state.reason
