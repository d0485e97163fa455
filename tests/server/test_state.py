"""Queries over REST."""

import asyncio
import csv
import io
from types import SimpleNamespace

from fastapi import FastAPI
from httpx import ASGITransport, AsyncClient

from rolling_panda import reasons, topics
from rolling_panda.messages.supervision import CutReport, SessionReport, VineReport
from server.api.state import camera_router
from tests.support.fake_wire import FakeWire
from tests.support.running_server import eventually, running_server


def test_everybody_who_is_signed_in_gets_the_report_and_its_cuts_as_a_table():
    cut = CutReport(
        cut_id="c1",
        point_id="p1",
        vine=3,
        spur=2,
        outcome="DONE",
        reason=reasons.said("=1+1"),
        ended_at=1769850000.0,
        seconds=3.25,
    )
    told = SessionReport(
        began_at=1769840000.0, written_at=1769850000.0, cuts=(cut,), cut_count=1, vines=(VineReport(vine=3, done=1),)
    )
    with running_server(FakeWire()) as server, server.client(role="viewer") as client:
        assert client.get("/api/report").status_code == 503
        assert "has not reported" in client.get("/api/report.csv").json()["reason"]
        server.wire.deliver(topics.REPORT, told)
        eventually(lambda: client.get("/api/report").status_code == 200)
        body = client.get("/api/report").json()
        assert body["cuts"][0]["seconds"] == 3.25 and body["vines"][0]["done"] == 1
        answer = client.get("/api/report.csv")
        assert answer.headers["content-type"].startswith("text/csv")
        (row,) = csv.DictReader(io.StringIO(answer.text))
        assert (row["vine"], row["outcome"], row["ended_at"]) == ("3", "DONE", "2026-01-31T09:00:00+00:00")
        assert row["reason"] == "'=1+1", "a spreadsheet does not take it for a formula"
        with server.visitor() as stranger:
            assert stranger.get("/api/report").status_code == 401


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
