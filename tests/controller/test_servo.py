"""Servoing on the last way to a cut: the blades close where the cane is seen, or where they would without."""

import msgspec
import numpy as np
import pinocchio as pin
import pytest

from controller.config import ControllerConfig
from controller.motion.follower import Measured
from controller.motion.tool_motion import Leg, ToolMotion
from controller.work.servo import CutServo
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import ON_THE_WAY, CutSight
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import vector3
from tests.support.controller_at_work import CONFIG, entry, finish, run_until, working
from tests.support.controller_config import controller_config
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicRobot

PLACE = np.array([0.4, 0.75, 1.0])
SHOWN = (point("a", vector3(PLACE)),)
SERVO: ControllerConfig = controller_config(CONFIG, work__servo=True)
#: As exact as pictures from near are.
SURE = (2.5e-7, 0.0, 0.0, 2.5e-7, 0.0, 2.5e-7)
#: The blades have closed so long after the order (s).
CLOSING_S = 0.3
#: Of the blades' middle where they close (m).
EXACT = 0.002


class Watching(KinematicRobot):
    """A robot whose camera sees the cane aside of where the close-up has seen it, in each picture on the way."""

    #: From the place of the point to the cane in picture number n, at a time (3, m); None for nothing.
    aside = staticmethod(lambda n, t: np.zeros(3))
    late_s = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        self.asked: list[tuple[float, float]] = []
        self.tools: list[np.ndarray] = []
        self._seen: list[tuple[float, CutSight]] = []
        self.ordered_at: float | None = None

    def close_up(self, request):
        if not request.point_id.startswith(ON_THE_WAY):
            seen = super().close_up(request)
            if seen.position is None:
                return seen
            by = self.aside(0, self.now)
            place = vector3(PLACE if by is None else PLACE + by)
            return msgspec.structs.replace(seen, position=place, distance=0.36)
        self.asked.append((self.now, float(np.linalg.norm(self.tool() - PLACE))))
        by = self.aside(len(self.asked), self.now)
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

    def tool(self) -> np.ndarray:
        return self.model.kinematics(self.q).T_odom_tool.translation.copy()

    def step(self):
        while self._seen and self._seen[0][0] <= self.now:
            self.hear(self._seen.pop(0)[1])
        self.tools.append(self.tool())
        out = super().step()
        if self.cuts and self.ordered_at is None:
            self.ordered_at = self.now
        return out


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


def still(n: int, t: float) -> np.ndarray:
    return np.zeros(3)


def moved(n: int, t: float) -> np.ndarray:
    """A cane that was 4 mm aside in the close-up."""
    return np.zeros(3) if n == 0 else np.array([0.004, 0.0, 0.0])


def swinging(frequency: float, phase: float):
    """A cane that swings by 4 mm to either side."""
    return lambda n, t: np.array([0.004 * np.sin(2 * np.pi * frequency * t + phase), 0.0, 0.0])


def test_the_blades_close_where_the_cane_is_seen_on_the_way(monkeypatch) -> None:
    r = cut(monkeypatch, moved)
    assert np.linalg.norm(blades(r) - moved(1, 0.0)) < EXACT
    away = [away for _, away in r.asked]
    assert len(away) >= 4 and min(away) >= SERVO.work.servo_until - 0.02
    apart = np.diff([at for at, _ in r.asked])
    assert apart.min() >= 1.0 / SERVO.work.servo_rate_hz - 0.011


def test_switched_off_it_asks_for_no_picture_and_cuts_where_the_close_up_was(monkeypatch) -> None:
    r = cut(monkeypatch, moved, controller_config(CONFIG, work__servo=False))
    assert r.asked == [] and np.linalg.norm(blades(r)) < EXACT


@pytest.mark.long
def test_a_swinging_cane_is_nearer_to_the_middle_of_the_blades_when_they_close(monkeypatch) -> None:
    without = controller_config(CONFIG, work__servo=False)
    off: dict[bool, list[float]] = {True: [], False: []}
    for frequency, phase in ((0.8, 0.5), (1.1, 2.1), (1.4, 3.7), (1.8, 5.3)):
        swing = swinging(frequency, phase)
        for servo, config in ((True, SERVO), (False, without)):
            r = cut(monkeypatch, swing, config)
            closed = r.ordered_at + CLOSING_S
            off[servo].append(float(blades(r)[0] - swing(1, closed)[0]))
    assert np.sqrt(np.mean(np.square(off[True]))) < 0.8 * np.sqrt(np.mean(np.square(off[False])))


def test_a_picture_says_nothing_about_the_place_along_the_cane(monkeypatch) -> None:
    r = cut(monkeypatch, lambda n, t: np.array([0.0, 0.0, 0.004 if n else 0.0]))
    assert abs(blades(r)[2]) < EXACT


@pytest.mark.parametrize(
    ("aside", "late_s"),
    [
        pytest.param(lambda n, t: None, 0.05, id="nothing is seen"),
        pytest.param(lambda n, t: np.array([0.018 if n else 0.0, 0.0, 0.0]), 0.05, id="another cane"),
        pytest.param(moved, 0.4, id="too old"),
    ],
)
def test_what_tells_nothing_leaves_the_motion_as_it_is(monkeypatch, aside, late_s) -> None:
    r = cut(monkeypatch, aside, late_s=late_s)
    assert r.asked and np.linalg.norm(blades(r)) < EXACT


def test_when_the_cane_is_lost_on_the_way_the_last_estimate_stands(monkeypatch) -> None:
    r = cut(monkeypatch, lambda n, t: moved(n, t) if n <= 3 else None)
    assert np.linalg.norm(blades(r) - moved(1, 0.0)) < EXACT
    another = cut(monkeypatch, lambda n, t: moved(n, t) if n != 4 else np.array([-0.015, 0.0, 0.0]))
    assert np.linalg.norm(blades(another) - moved(1, 0.0)) < EXACT


def closing(r: Watching) -> list[str]:
    """What the log says of the estimate on which the blades close."""
    return [text for text in r.events if "blades close" in text]


def test_the_log_tells_how_old_the_estimate_is_on_which_the_blades_close(monkeypatch) -> None:
    for shown in (3, 1000):
        r = cut(monkeypatch, lambda n, t, shown=shown: still(n, t) if n <= shown else None, late_s=0.2)
        assert r.ordered_at is not None
        (text,) = closing(r)
        age = r.ordered_at - r.asked[min(shown, len(r.asked)) - 1][0]
        assert float(text.split(" s before")[0].split()[-1]) == pytest.approx(age, abs=0.08) and age > 0.3
    (text,) = closing(cut(monkeypatch, lambda n, t: None if n else np.zeros(3)))
    assert "no picture on the last way" in text
    assert not closing(cut(monkeypatch, still, controller_config(CONFIG, work__servo=False)))


def test_a_correction_is_bounded_in_size_and_the_blades_go_in_no_faster(monkeypatch) -> None:
    r = cut(monkeypatch, lambda n, t: np.array([0.012 if n else 0.0, 0.0, 0.0]))
    assert abs(blades(r)[0] - SERVO.work.servo_reach) < EXACT
    tools = np.array(r.tools)
    speed = np.linalg.norm(np.diff(tools, axis=0), axis=1) / r.dt
    near = (np.linalg.norm(tools[:-1] - PLACE, axis=1) < 0.015) & (np.diff(tools[:, 1]) > 0.0)
    assert speed[near].max() < SERVO.motion.cut_speed * 1.3


def test_corrections_that_follow_one_another_fast_do_not_add_up_their_speeds(monkeypatch) -> None:
    fast = controller_config(CONFIG, work__servo=True, work__servo_rate_hz=30.0)
    corrected = cut(monkeypatch, lambda n, t: np.array([min(0.003 * n, 0.012), 0.0, 0.0]), fast, late_s=0.01)
    straight = cut(monkeypatch, still, fast)
    common = min(len(corrected.tools), len(straight.tools))
    aside = np.subtract(corrected.tools[:common], straight.tools[:common])[:, 0]
    speed = np.abs(np.diff(aside)).max() / corrected.dt
    assert 0.5 * fast.motion.cut_speed < speed < 1.15 * fast.motion.cut_speed


def test_a_point_that_turns_out_to_be_on_another_cane_is_left_on_the_way(monkeypatch) -> None:
    monkeypatch.setattr("tests.support.controller_at_work.KinematicRobot", Watching)
    monkeypatch.setattr(Watching, "aside", staticmethod(moved))
    r = working(SHOWN, config=SERVO)
    run_until(r, lambda s: s is not None and s.phase == "ADVANCE", 20.0)
    r.run(0.3)
    r.show((msgspec.structs.replace(SHOWN[0], revision=2, cane=1),))
    finish(r, 30.0)
    assert r.cuts == [] and entry(r, "a").state == "PROPOSED"


@pytest.mark.parametrize("along", [0.0, 0.005])
def test_ground_that_carries_the_cut_elsewhere_is_no_error_of_the_motion(along):
    """The motion follows the ground by itself, and may end beside the point: pictures of the point ask for no more."""
    servo, tilted = CutServo(SERVO.work), pin.exp3(np.array([0.26, 0.0, 0.0]))
    servo.begin("a", PLACE, tilted)
    by = np.array([0.006, 0.0, -0.004])
    servo.carry(by)
    carried = ToolMotion(
        SERVO.motion,
        SERVO.whole_body,
        pin.SE3(tilted, PLACE - [0.0, 0.0, 0.2]),
        np.zeros(12),
        [Leg(pin.SE3(tilted, PLACE + by + [0.0, 0.0, along]), np.zeros(12), 0.3)],
    )
    robot = Measured(np.zeros(12), RobotModel().kinematics(np.zeros(12)), np.zeros(9))
    for number in range(1, 6):
        servo.asked(number, 0.1 * number)
        sight = CutSight(
            header=m.Header(0.1 * number, "odom"),
            point_id="a",
            number=number,
            position=vector3(PLACE + by),
            covariance=SURE,
        )
        servo.update(sight, 0.1 * number + 0.05)
        servo.correct(carried, robot)
    np.testing.assert_allclose(carried.goal.translation, PLACE + by + [0.0, 0.0, along], atol=1e-9)
