"""Servoing on the last way to a cut: the blades close where the cane is seen on the way, or where they would without."""

import msgspec
import numpy as np
import pytest

from controller.config import ControllerConfig
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import ON_THE_WAY, CutSight
from rolling_panda.model.wire_values import vector3
from tests.support.controller_at_work import CONFIG, entry, finish, run_until, working
from tests.support.controller_config import controller_config
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicRobot

pytestmark = pytest.mark.long

PLACE = np.array([0.4, 0.75, 1.0])
SHOWN = (point("a", vector3(PLACE)),)
SERVO: ControllerConfig = controller_config(CONFIG, work__servo=True)
#: As exact as pictures from near are.
SURE = (2.5e-7, 0.0, 0.0, 2.5e-7, 0.0, 2.5e-7)
#: Of the blades' middle where they close (m).
EXACT = 0.002


class Watching(KinematicRobot):
    """A robot whose camera sees the cane aside of where the close-up has seen it, in each picture on the way."""

    #: From the close-up's place to where picture number n shows the cane (3, m); None for nothing.
    aside = staticmethod(lambda n: np.array([0.004, 0.0, 0.0]))
    late_s = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        self.asked: list[tuple[float, float]] = []
        self.tools: list[np.ndarray] = []
        self._seen: list[tuple[float, CutSight]] = []

    def close_up(self, request):
        if not request.point_id.startswith(ON_THE_WAY):
            return super().close_up(request)
        self.asked.append((self.now, float(np.linalg.norm(self.tool() - PLACE))))
        by = self.aside(len(self.asked))
        sight = CutSight(
            header=m.Header(self.now, "odom"),
            point_id=request.point_id.removeprefix(ON_THE_WAY),
            number=request.number,
            reason=reasons.no_cane_at_place() if by is None else None,
            position=None if by is None else vector3(PLACE + by),
            covariance=None if by is None else SURE,
        )
        self._seen.append((self.now + self.late_s, sight))
        return None

    def hear(self, message) -> None:
        if message is not None:
            super().hear(message)

    def tool(self) -> np.ndarray:
        return self.model.kinematics(self.q).T_odom_tool.translation.copy()

    def step(self):
        while self._seen and self._seen[0][0] <= self.now:
            super().hear(self._seen.pop(0)[1])
        self.tools.append(self.tool())
        return super().step()


def cut(monkeypatch, aside, config=SERVO, late_s=0.05) -> Watching:
    """A point that is cut while its pictures show the cane `aside`."""
    monkeypatch.setattr("tests.support.controller_at_work.KinematicRobot", Watching)
    monkeypatch.setattr(Watching, "aside", staticmethod(aside))
    monkeypatch.setattr(Watching, "late_s", late_s)
    r = working(SHOWN, config=config)
    finish(r, 30.0)
    assert entry(r, "a").state == "DONE"
    return r


def blades(r: Watching) -> np.ndarray:
    """Where the blades closed, from the place of the close-up (3, m)."""
    return r.cuts[0][1][:3, 3] - PLACE


def test_the_blades_close_where_the_cane_is_seen_on_the_way(monkeypatch) -> None:
    seen = np.array([0.004, 0.0, 0.0])
    r = cut(monkeypatch, lambda _: seen)
    assert np.linalg.norm(blades(r) - seen) < EXACT
    away = [away for _, away in r.asked]
    assert len(away) >= 4 and min(away) >= SERVO.work.servo_until - 0.02
    apart = np.diff([at for at, _ in r.asked])
    assert apart.min() >= 1.0 / SERVO.work.servo_rate_hz - 0.011


def test_switched_off_it_asks_for_no_picture_and_cuts_where_the_close_up_was(monkeypatch) -> None:
    r = cut(monkeypatch, lambda _: np.array([0.004, 0.0, 0.0]), controller_config(CONFIG, work__servo=False))
    assert r.asked == [] and np.linalg.norm(blades(r)) < EXACT


def test_of_a_cane_that_sways_the_middle_is_cut(monkeypatch) -> None:
    r = cut(monkeypatch, lambda n: np.array([0.002 + 0.004 * (-1) ** n, 0.0, 0.0]))
    assert abs(blades(r)[0] - 0.002) < 0.0025


def test_a_picture_says_nothing_about_the_place_along_the_cane(monkeypatch) -> None:
    r = cut(monkeypatch, lambda _: np.array([0.0, 0.0, 0.004]))
    assert abs(blades(r)[2]) < EXACT


@pytest.mark.parametrize(
    ("aside", "late_s"),
    [
        pytest.param(lambda _: None, 0.05, id="nothing is seen"),
        pytest.param(lambda _: np.array([0.016, 0.0, 0.0]), 0.05, id="another cane"),
        pytest.param(lambda _: np.array([0.004, 0.0, 0.0]), 0.4, id="too old"),
    ],
)
def test_what_tells_nothing_leaves_the_motion_as_it_is(monkeypatch, aside, late_s) -> None:
    r = cut(monkeypatch, aside, late_s=late_s)
    assert r.asked and np.linalg.norm(blades(r)) < EXACT


def test_when_the_cane_is_lost_on_the_way_the_last_estimate_stands(monkeypatch) -> None:
    seen = np.array([0.004, 0.0, 0.0])
    r = cut(monkeypatch, lambda n: seen if n <= 3 else None)
    assert np.linalg.norm(blades(r) - seen) < EXACT
    another = cut(monkeypatch, lambda n: seen if n != 4 else np.array([-0.012, 0.0, 0.0]))
    assert np.linalg.norm(blades(another) - seen) < EXACT


def test_a_correction_is_bounded_in_size_and_the_blades_go_in_no_faster(monkeypatch) -> None:
    r = cut(monkeypatch, lambda _: np.array([0.011, 0.0, 0.0]))
    assert abs(blades(r)[0] - SERVO.work.servo_reach) < EXACT
    tools = np.array(r.tools)
    speed = np.linalg.norm(np.diff(tools, axis=0), axis=1) / r.dt
    near = (np.linalg.norm(tools[:-1] - PLACE, axis=1) < 0.02) & (np.diff(tools[:, 1]) > 0.0)
    assert speed[near].max() < SERVO.motion.cut_speed * 1.6
    sideways = np.abs(np.diff(tools[:, 0])) / r.dt
    advancing = (PLACE[1] - tools[:-1, 1] < 0.15) & (np.diff(tools[:, 1]) > 0.0)
    assert sideways[advancing].max() < SERVO.motion.cut_speed * 1.6


def test_a_point_that_is_rejected_on_the_way_is_left(monkeypatch) -> None:
    monkeypatch.setattr("tests.support.controller_at_work.KinematicRobot", Watching)
    monkeypatch.setattr(Watching, "aside", staticmethod(lambda _: np.array([0.004, 0.0, 0.0])))
    r = working(SHOWN, config=SERVO)
    run_until(r, lambda s: s is not None and s.phase == "ADVANCE", 20.0)
    r.run(0.3)
    r.show((msgspec.structs.replace(SHOWN[0], revision=2, cane=1),))
    finish(r, 30.0)
    assert r.cuts == [] and entry(r, "a").state == "PROPOSED"
