"""REST for what does not change about the robot."""

from fastapi import APIRouter
from pydantic import BaseModel

from server.desk import Desk
from server.operator_api import Caller


class RobotFacts(BaseModel):
    """Of the robot as built: the lower and upper limit of each joint of the arm, from its base on (rad)."""

    arm_limits: list[tuple[float, float]]


def robot_router(desk: Desk) -> APIRouter:
    """`/api/robot`."""
    router = APIRouter(prefix="/api", tags=["state"])

    @router.get("/robot")
    async def robot(session: Caller) -> RobotFacts:
        """What a page asks once."""
        return RobotFacts(arm_limits=list(desk.view.arm_limits))

    return router
