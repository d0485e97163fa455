"""The next calibration of the camera: pictures of the board in, an offer out. What is refused changes nothing."""

import cv2
import numpy as np
import pinocchio as pin
import pytest
from msgspec.structs import replace

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import survey_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Row
from bridge.sim.world.config import CALM, WorldConfig
from bridge.sim.world.errors import draw_errors
from controller.config import ControllerConfig
from controller.work.camera_views import ROW, view_postures
from perception.calibration.camera import CameraCalibration
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import choose_segmenter
from rolling_panda import reasons
from rolling_panda.commands import UseCamera
from rolling_panda.messages.perception import CALIBRATION
from rolling_panda.model.robot import RobotModel, mount_pose, turn_and_shift

MODEL = RobotModel()
SEED = 3
POSTURES = view_postures(MODEL, np.array(ControllerConfig().work.home))
TURNED = replace(CALM, hand_eye_angle=0.01, hand_eye_shift=0.005, focal_error=0.003)


@pytest.fixture(scope="module")
def pictures():
    """The board from all around, by a camera that is not where it is drawn."""
    return photographed(TURNED, board=True)


def photographed(world: WorldConfig, board: bool, count: int = 16):
    lens = CameraConfig(board=board, calibration_angle=0.0, appearance=0.0)
    camera = Camera(lens, SEED, world)
    frames = [survey_frame(camera, Row(()), MODEL, k, arm=tuple(p.tolist())) for k, p in enumerate(POSTURES[:count], 1)]
    return [replace(frame, point_id=f"{CALIBRATION}{k}", number=k) for k, frame in enumerate(frames, 1)]


def calibration(kept=None, mount=None):
    keep = (lambda each: None) if kept is None else kept.append
    return CameraCalibration(RobotModel(), mount, keep, clock=lambda: 1.8e9)


@pytest.mark.long
def test_the_camera_is_found_where_it_is_and_used_when_an_operator_says_so(pictures):
    kept = []
    camera = calibration(kept)
    results = [camera.look(frame) for frame in pictures]
    assert [result.finding for result in results].count("seen") >= 14
    assert [result.number for result in results] == list(range(1, 17))
    offer = camera.state.offer
    errors = draw_errors(TURNED, SEED)
    true = MODEL.T_flange_camera * pin.SE3(errors.hand_eye, errors.hand_eye_shift)
    before, after = turn_and_shift(true, MODEL.T_flange_camera), turn_and_shift(true, mount_pose(offer))
    assert before[0] > 0.005 and after[0] < 0.001 and after[1] < 0.0007
    assert offer.focal == pytest.approx(1.0 / errors.focal, abs=1e-3) or offer.focal == pytest.approx(
        errors.focal, abs=1e-3
    )
    assert kept == [] and camera.state.mount is None, "nothing is used before somebody says so"
    assert not camera.use(offer.made_at - 1.0).ok and kept == [], "another one than was seen"
    answer = camera.use(offer.made_at)
    assert answer.ok and answer.reason.code == "calibration_used"
    assert kept == [offer] and camera.state.mount == offer and camera.state.offer is None
    assert not camera.use(offer.made_at).ok


@pytest.mark.long
def test_too_few_pictures_give_no_offer_and_a_new_round_begins_anew(pictures):
    camera = calibration()
    for frame in pictures[:5]:
        camera.look(frame)
    assert camera.state.offer is None and camera.state.refused.code == "calibration_few_views"
    for frame in pictures:
        camera.look(frame)
    assert camera.state.offer is not None
    camera.look(pictures[0])
    assert camera.state.offer is None and camera.state.views == 1


def test_without_a_board_nothing_is_seen_and_the_old_calibration_stays():
    camera = calibration()
    assert camera.look(photographed(CALM, board=False, count=1)[0]).finding == "unseen"
    assert camera.state.views == 0 and camera.state.offer is None
    refused = camera.use(1.8e9)
    assert not refused.ok and refused.reason.code == "no_calibration_offered"


def test_how_much_of_the_board_is_seen_is_told_while_it_comes_into_the_picture():
    frame = photographed(CALM, board=True, count=1)[0]
    whole = cv2.imdecode(np.frombuffer(frame.color_jpeg, np.uint8), cv2.IMREAD_COLOR)
    told, corners = [], set()
    for shown in range(0, whole.shape[1], 16):
        part = whole.copy()
        part[:, shown:] = 128
        result = calibration().look(replace(frame, color_jpeg=cv2.imencode(".jpg", part)[1].tobytes()))
        told.append("seen" if result.reason is None else result.reason.code)
        if result.reason is not None and result.reason.code == "board_in_part":
            corners.add(dict(result.reason.values)["corners"])
            assert dict(result.reason.values)["needed"] == 12
    assert list(dict.fromkeys(told)) == ["board_not_in_picture", "board_in_part", "seen"]
    assert min(corners) > 0 and 8 < max(corners) < 12


@pytest.mark.long
def test_a_calibration_that_cannot_be_kept_is_not_used(pictures):
    def full(mount):
        raise OSError(28, "No space left on device")

    camera = CameraCalibration(RobotModel(), None, full, clock=lambda: 1.8e9)
    for frame in pictures:
        camera.look(frame)
    answer = camera.use(1.8e9)
    assert not answer.ok and answer.reason == reasons.calibration_not_kept("No space left on device")
    assert camera.state.mount is None and camera.state.offer is not None


@pytest.mark.long
def test_a_camera_far_from_where_it_is_drawn_is_not_offered():
    camera = calibration()
    for frame in photographed(replace(CALM, hand_eye_angle=0.2), board=True):
        camera.look(frame)
    assert camera.state.offer is None and camera.state.refused.code == "calibration_far"


@pytest.mark.long
def test_a_turned_camera_is_told_from_the_row_alone_and_its_correction_takes_the_points_anew():
    row, kept = grow(VineyardConfig(), 2002), []
    camera = Camera(CameraConfig(), 2002, replace(CALM, hand_eye_angle=0.01))
    seeing = Perception(PerceptionConfig(), choose_segmenter("labels", None), keep=kept.append)
    places = view_postures(MODEL, np.array(ControllerConfig().work.home), ROW)
    seeing.process(survey_frame(camera, row, MODEL, 1))
    assert seeing.camera.state.warning is None
    for number, posture in enumerate(places, 2):
        seeing.process(survey_frame(camera, row, MODEL, number, arm=tuple(posture.tolist())))
    state = seeing.camera.state
    true = pin.log3(draw_errors(replace(CALM, hand_eye_angle=0.01), 2002).hand_eye)
    assert np.abs(np.array(state.turned) - true).max() < 0.003, "beside 1 mrad of the camera's own"
    assert state.warning.code == "camera_looks_left" and state.offer.source == "work"
    points = {point.point_id for point in seeing.points().points}
    assert points and seeing.answer(UseCamera(user="ada", made_at=state.offer.made_at)).ok
    assert kept == [state.offer] and not seeing.points().points and len(seeing.withdrawn) == len(points)
    for number, posture in enumerate(places, 20):
        seeing.process(survey_frame(camera, row, MODEL, number, arm=tuple(posture.tolist())))
    assert seeing.camera.state.warning is None and seeing.camera.state.offer is None
    assert not points & {point.point_id for point in seeing.points().points}, "no name is used twice"


@pytest.mark.long
def test_an_old_calibration_is_told(pictures):
    camera = calibration()
    for frame in pictures:
        camera.look(frame)
    old = replace(camera.state.offer, made_at=1.8e9 - 200 * 86400.0)
    assert calibration(mount=old).state.warning.code == "calibration_old"
    assert calibration(mount=camera.state.offer).state.warning is None
