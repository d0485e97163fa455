"""REST for a recording that is played in the robot's place."""

from fastapi import APIRouter, Response

from rolling_panda.errors import ServiceError
from rolling_panda.messages.commands import SeekReplay
from server.api.answers import ANSWERS, Caller, answer
from server.api.bodies import Seek
from server.robots.context import Result, RobotContext


def replay_router(desk: RobotContext) -> APIRouter:
    """Everything under `/api/replay`."""
    router = APIRouter(prefix="/api", tags=["replay"])

    @router.post("/replay", responses=ANSWERS)
    async def seek(session: Caller, request: Seek) -> Response:
        """Play from somewhere else, stand still, or go on; 409 while no recording is played."""
        if desk.link.replay.peek() is None:
            return answer(Result(409, False, "this is no recording but a robot"))
        try:
            told = await desk.link.seek(SeekReplay(position_s=request.position_s, playing=request.playing))
        except ServiceError as error:
            return answer(Result(503, False, str(error)))
        return answer(Result(200, told.ok, told.reason))

    return router
