"""REST for what does not change about the robot."""

from typing import Annotated

from fastapi import APIRouter
from pydantic import BaseModel, Field

from server.api.answers import SIGNED_IN, Caller
from server.robots.context import RobotContext


class RobotFacts(BaseModel):
    """Of the robot as built: the lower and upper limit of each joint of the arm, from its base on (rad)."""

    arm_limits: list[Annotated[list[float], Field(min_length=2, max_length=2)]]


def robot_router(desk: RobotContext) -> APIRouter:
    """`/api/robot`."""
    router = APIRouter(prefix="/api", tags=["state"])

    @router.get("/robot", responses=SIGNED_IN)
    async def robot(session: Caller) -> RobotFacts:
        """What a page asks once."""
        return RobotFacts(arm_limits=[list(limits) for limits in desk.view.arm_limits])

    return router
