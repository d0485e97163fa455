"""Queries over REST."""

import asyncio
import csv
import io
import time
from types import SimpleNamespace

import pytest
from fastapi import FastAPI
from httpx import ASGITransport, AsyncClient

from rolling_panda import __version__, reasons, topics
from rolling_panda import messages as m
from rolling_panda.messages.supervision import CutReport, SessionReport, Timeline, TimelineEvent, VineReport
from server.api.state import camera_router
from tests.support.fake_wire import FakeWire, joints
from tests.support.running_server import eventually, running_server


@pytest.mark.long
def test_everybody_who_is_signed_in_gets_the_report_and_its_cuts_as_a_table():
    cut = CutReport(
        cut_id="c1",
        point_id="p1",
        vine=3,
        spur=2,
        outcome="DONE",
        reason=reasons.said("=1+1"),
        ended_at=1769850000.0,
        seconds=3.2549,
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
        assert body["cuts"][0]["seconds"] == 3.2549 and body["vines"][0]["done"] == 1
        answer = client.get("/api/report.csv")
        assert answer.headers["content-type"].startswith("text/csv")
        (row,) = csv.DictReader(io.StringIO(answer.text))
        assert (row["vine"], row["outcome"], row["ended_at"]) == ("3", "DONE", "2026-01-31T09:00:00+00:00")
        assert row["seconds"] == "3.25"
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


@pytest.mark.long
def test_the_timeline_is_given_as_the_controller_tells_it():
    event = TimelineEvent(at=1769840010.0, kind="mode", before="IDLE", mode="READY", reason=reasons.said("armed"))
    told = Timeline(began_at=1769840000.0, ended_at=1769850000.0, events=(event,))
    with running_server(FakeWire()) as server, server.client(role="viewer") as client:
        assert client.get("/api/timeline").status_code == 503
        server.wire.deliver(topics.TIMELINE, told)
        eventually(lambda: client.get("/api/timeline").status_code == 200)
        (event,) = client.get("/api/timeline").json()["events"]
        assert (event["kind"], event["before"], event["mode"]) == ("mode", "IDLE", "READY")


@pytest.mark.long
def test_the_diagnostics_tell_versions_and_what_comes_in_of_each_topic():
    with running_server(FakeWire()) as server, server.client(role="viewer") as client:
        began = time.monotonic() - 1.0
        for number in range(11):
            server.wire.deliver(topics.JOINTS, joints(), began + 0.01 * number)
        server.wire.deliver(topics.PROGRAM, m.Program(process="bridge", version="9.9", began_at=1769840000.0))
        server.wire.on_reject("state/odometry", reasons.said("no odometry"))
        told = client.get("/api/diagnostics").json()
        programs = {each["process"]: each for each in told["programs"]}
        assert programs["bridge"]["version"] == "9.9" and programs["server"]["version"] == __version__
        rows = {each["name"]: each for each in told["topics"]}
        assert set(rows) == {topic.name for topic in topics.TOPICS}
        row = rows["state/joints"]
        assert row["received"] and row["count"] == 11 and abs(row["rate_hz"] - 100.0) < 1e-6
        assert 0.0 <= row["age_s"] < 60.0
        assert rows["state/odometry"]["rejected"] == 1 and rows["state/odometry"]["age_s"] is None
        assert not rows["command/motion"]["received"], "the server does not listen to it"
