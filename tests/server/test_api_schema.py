"""Whatever is sent to whatever the server describes: no failure of its own, and nothing done for who may not."""

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings

from rolling_panda import topics
from tests.support.fake_wire import FakeWire, bridge_state, controller_state, pruning_point, pruning_points, telling
from tests.support.running_server import running_server

# Warnings of hypothesis about the strategies of schemathesis: `random` in them, and large values in messages.
pytestmark = [
    pytest.mark.filterwarnings("ignore:Do not use the `random` module"),
    pytest.mark.filterwarnings("ignore:Generating overly large repr"),
]
#: What the server answers without a session.
PUBLIC = {"/api/health", "/version", "/api/sign-in", "/api/sign-out"}
OPERATIONS = 76


@pytest.fixture(scope="module")
def server():
    wire = FakeWire()
    with running_server(wire) as running, telling(wire):
        wire.deliver(topics.BRIDGE, bridge_state("s"))
        wire.deliver(topics.CONTROLLER, controller_state())
        wire.deliver(topics.POINTS, pruning_points(pruning_point()))
        yield running


@pytest.fixture(scope="module")
def operations(server):
    with server.visitor() as visitor:
        schema = schemathesis.openapi.from_dict(visitor.get("/api/openapi.json").json())
    found = [result.ok() for result in schema.get_all_operations()]
    assert 20 <= len(found) <= OPERATIONS
    return found


def tried(operation, check, examples):
    """Send an operation every kind of request, and let `check(case)` judge."""

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck))
    @given(case=operation.as_strategy())
    def run(case):
        check(case)

    run()


def send(client, case):
    """A generated request as a client sends it."""
    kwargs = case.as_transport_kwargs(base_url=str(client.base_url))
    body = {name: kwargs[name] for name in ("json", "params") if kwargs.get(name) is not None}
    if kwargs.get("data") is not None:
        body["content"] = kwargs["data"]
    headers = {"content-type": "application/json"} if "json" in body else {}
    return client.request(kwargs["method"], kwargs["url"], headers=headers, **body)


@pytest.mark.long
@pytest.mark.parametrize("examples", [3, pytest.param(200, marks=pytest.mark.slow)])
def test_nothing_that_is_sent_makes_the_server_fail(server, operations, examples):
    for operation in operations:
        with server.client() as client:

            def check(case, client=client):
                answer = send(client, case)
                # 503 is the honest answer where the robot does not answer, and says so.
                expected = answer.status_code == 503 and answer.json()["ok"] is False
                assert answer.status_code < 500 or expected, f"{answer.status_code} {answer.text[:300]}"
                if answer.status_code >= 400:
                    assert answer.json()["reason"], answer.text

            tried(operation, check, examples)


@pytest.mark.long
@pytest.mark.parametrize("examples", [3, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("who", ["visitor", "foreign page", "viewer"])
def test_nothing_is_done_for_who_may_not(server, operations, who, examples):
    for operation in operations:
        posts = operation.method.lower() == "post"
        if operation.path in PUBLIC and (who != "foreign page" or not posts):
            continue
        if (who != "visitor" and not posts) or (who == "viewer" and operation.path == "/api/stop"):
            continue
        with server.client(role="viewer" if who == "viewer" else "supervisor") as client:
            if who == "visitor":
                client.cookies.clear()
            if who == "foreign page":
                client.headers["origin"] = "https://elsewhere.example"
            server.wire.asked.clear()

            def check(case, client=client, path=operation.path):
                answer = send(client, case)
                assert answer.status_code >= 400, f"{path} was answered {answer.status_code} to a {who}"

            tried(operation, check, examples)
            assert server.wire.asked == []
