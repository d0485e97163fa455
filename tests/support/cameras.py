"""Cameras for tests: where one is, and one that sees nothing."""

import numpy as np

from bridge.core.picture import Picture
from bridge.sim.camera.frame import survey_place
from bridge.sim.vineyard.row import Array, Row
from rolling_panda.model.robot import RobotModel, configuration

MODEL = RobotModel()
#: Where base and arm are in a survey, and the camera on the tool (pin.SE3).
BASE, POSTURE = survey_place()
_SURVEY = configuration(BASE, POSTURE)
T_TOOL_CAMERA = MODEL.pose(_SURVEY, MODEL.tool_id).inverse() * MODEL.pose(_SURVEY, MODEL.camera_id)


def looking_left(x: float = 0.0, y: float = 0.0, z: float = 1.0) -> Array:
    """Level, towards +y: image right is +x, image down is -z."""
    T = np.eye(4)
    T[:3, :3] = np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    T[:3, 3] = [x, y, z]
    return T


class Blind:
    """A renderer without a camera."""

    def expose(self, row: Row, T_world_camera: Array, at: float, velocity: Array) -> bool:
        return False

    def ready(self) -> Picture | None:
        return None

    def close(self) -> None:
        pass
