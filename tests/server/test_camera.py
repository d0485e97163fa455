import asyncio
from types import SimpleNamespace

from fastapi import FastAPI
from httpx import ASGITransport, AsyncClient

from server.api.camera import camera_router


def test_a_frame_that_pages_are_told_of_is_there_though_it_is_not_kept_yet():
    newest = SimpleNamespace(message=SimpleNamespace(sequence=3, color_jpeg=b"jpeg3"))
    link = SimpleNamespace(camera=SimpleNamespace(peek=lambda: newest), images={2: b"jpeg2"})
    app = FastAPI()
    app.include_router(camera_router(SimpleNamespace(link=link)))

    async def asked(number):
        async with AsyncClient(transport=ASGITransport(app), base_url="http://robot") as client:
            return await client.get(f"/camera/color.jpg?n={number}")

    assert asyncio.run(asked(3)).content == b"jpeg3"
    assert asyncio.run(asked(2)).content == b"jpeg2"
    assert asyncio.run(asked(1)).status_code == 404
