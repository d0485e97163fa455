"""`rolling-panda bench joints`: errors of the arm before and after its calibration by the board.

A simulated arm whose encoders are off looks at the board; its pictures are rendered, without physics. Judged are the
offsets of joints 2 to 6, the place of the tool in random postures about the survey posture, and the place of the tool
against a point there that the camera has seen in the survey posture. For that the camera is calibrated by the same
pictures: before without the joints, after with them.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from benchmarks.common.documents import bench_parser, write
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import survey_frame, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.camera.sensors import miscalibration
from bridge.sim.vineyard.row import Array, Row
from bridge.sim.world.config import PRESETS, WorldConfig
from bridge.sim.world.errors import Errors, draw_errors
from controller.config import ControllerConfig
from controller.work.camera_views import JOINTS, view_postures
from perception.calibration.board_view import BoardView, find_board
from perception.calibration.hand_eye import CalibrationError, HandEye, calibrate
from perception.segmentation.frame import decode_frame
from rolling_panda.model.robot import ARM_Q, RobotModel, configuration

#: Work postures: so many, with every joint up to this far from the survey posture (rad).
_POSTURES, _SPREAD = 200, 0.6
_CAMERA = CameraConfig(board=True)
_HOME = np.array(ControllerConfig().work.home)


@dataclass(frozen=True)
class Judged:
    """Errors of an arm with a calibration.

    Attributes:
        offsets: Of joints 2 to 6 (degrees).
        tool: Distance of the tool from where it is told to be, in each posture (m).
        seen: The same from a point that the camera has seen (m); empty if the camera's calibration was refused.
        pixels: Reprojection error (px); None if it was refused.
        refused: Why there is no calibration of the camera, or of the arm.
    """

    offsets: list[float]
    tool: list[float]
    seen: list[float]
    pixels: float | None = None
    refused: str = ""


def measure(seed: int, world: WorldConfig) -> tuple[Judged, Judged]:
    """Let the arm of a seed look at the board, and judge it before and after."""
    model, errors = RobotModel(), draw_errors(world, seed)
    camera = Camera(_CAMERA, seed, world)
    views: list[BoardView] = []
    for number, posture in enumerate(view_postures(model, _HOME, JOINTS), 1):
        arm = tuple(posture.tolist())
        frame = survey_frame(camera, Row(()), model, number, arm=arm, offsets=errors.joint_offset)
        q = configuration(frame.base, frame.position)
        found = find_board(decode_frame(frame, model), frame.intrinsics, model.pose(q, model.flange_id), q)
        views += [found] if isinstance(found, BoardView) else []
    before, after = (_judged(seed, model, errors, views, arm) for arm in (None, RobotModel()))
    return before, after


def _judged(seed: int, model: RobotModel, errors: Errors, views: list[BoardView], arm: RobotModel | None) -> Judged:
    fit: HandEye | None = None
    refused = ""
    try:
        fit = calibrate(views, arm)
    except CalibrationError as error:
        refused = error.reason.code
    offsets = np.zeros(7) if fit is None else fit.offsets
    tool, seen = [], []
    for posture in _HOME + np.random.default_rng(seed).uniform(-_SPREAD, _SPREAD, (_POSTURES, 7)):
        true, told = (_place(model, posture - off, model.tool_id) for off in (errors.joint_offset, offsets))
        tool.append(float(np.linalg.norm(true.translation - told.translation)))
        if fit is not None:
            turn = errors.hand_eye @ miscalibration(_CAMERA.calibration_angle, seed)
            mounted = model.T_flange_camera * pin.SE3(turn, errors.hand_eye_shift)
            T_true = _place(model, _HOME - errors.joint_offset, model.flange_id) * mounted
            T_told = _place(model, _HOME - offsets, model.flange_id) * fit.T_flange_camera
            point = T_told.act(T_true.actInv(true.translation))
            seen.append(float(np.linalg.norm(point - told.translation)))
    left = np.degrees(errors.joint_offset - offsets)[1:6].tolist()
    return Judged(left, tool, seen, None if fit is None else fit.pixels, refused)


def _place(model: RobotModel, arm: Array, frame_id: int) -> pin.SE3:
    q = configuration(*survey_place())
    q[ARM_Q] = arm
    return model.pose(q, frame_id)


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("joints", __doc__)
    parser.add_argument("--preset", default="field", choices=tuple(PRESETS), help="world (default: %(default)s)")
    parser.add_argument("--offset", type=float, help="SD of the joints' zeros in degrees, in place of the preset's")
    parser.add_argument("--seed", type=int, default=2500, help="first seed (default: %(default)s)")
    parser.add_argument("--count", type=int, default=5, help="arms (default: %(default)s)")
    words = parser.parse_args(argv)
    world = PRESETS[words.preset]
    if words.offset is not None:
        world = replace(world, joint_offset=float(np.radians(words.offset)))
    found = []
    for seed in range(words.seed, words.seed + words.count):
        found.append(measure(seed, world))
        print(f"seed {seed}: {_told(found[-1:])}", flush=True)
        document = {
            "preset": words.preset,
            "offset_deg": float(np.degrees(world.joint_offset)),
            "results": [
                {"seed": words.seed + k, "before": asdict(before), "after": asdict(after)}
                for k, (before, after) in enumerate(found)
            ],
        }
        write(words.json, document)
    print(f"{len(found)} arms: {_told(found)}")
    return 0


def _told(found: Sequence[tuple[Judged, Judged]]) -> str:
    return "; ".join(
        f"{name} {_words(side)}" for name, side in zip(("before", "after"), zip(*found, strict=True), strict=True)
    )


def _words(judged: Sequence[Judged]) -> str:
    offsets = np.abs([each.offsets for each in judged])
    pixels = [each.pixels for each in judged if each.pixels is not None]
    refused = [each.refused for each in judged if each.refused]
    return (
        f"offsets mean {offsets.mean():.4f}, max {offsets.max():.4f} degrees, "
        f"tool {_mm([off for each in judged for off in each.tool])}, "
        f"against what the camera saw {_mm([off for each in judged for off in each.seen])}, "
        f"{np.mean(pixels) if pixels else np.nan:.2f} px"
        + (f", refused {len(refused)}: {', '.join(sorted(set(refused)))}" if refused else "")
    )


def _mm(distances: list[float]) -> str:
    if not distances:
        return "-"
    p95, most = np.quantile(distances, 0.95), max(distances)
    return f"{1e3 * np.mean(distances):.2f} (p95 {1e3 * p95:.2f}, max {1e3 * most:.2f}) mm"
