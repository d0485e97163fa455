"""REST for the image of the camera on the hand."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from server.api.answers import ABSENT, WRONG, answer, gives
from server.robots.context import Result, RobotContext


def camera_router(desk: RobotContext) -> APIRouter:
    """`/camera/color.jpg`."""
    router = APIRouter()

    @router.get(
        "/camera/color.jpg",
        tags=["state"],
        response_class=Response,
        responses=gives("image/jpeg", ABSENT, WRONG),
    )
    async def camera(n: Annotated[int, Query(ge=0)] | None = None) -> Response:
        """The newest image of the eye-in-hand camera, JPEG; with `n` that of frame `n`, one of the newest few."""
        frame = desk.link.camera.peek()
        if frame is None:
            return answer(Result(404, False, "no camera image has come yet"))
        # The newest is told to the pages before it is among the kept ones, which are heard on a thread of their own.
        images = {**desk.link.images, frame.message.sequence: frame.message.color_jpeg}
        image = images.get(frame.message.sequence if n is None else n)
        if image is None:
            return answer(Result(404, False, f"frame {n} is not among the newest ones; {frame.message.sequence} is"))
        return Response(image, media_type="image/jpeg")

    return router
