"""Every request that the server describes, by every role: what a role may not do is refused before anybody is asked."""

import re

import pytest

from rolling_panda import topics
from rolling_panda.messages.supervision import PreviewState
from rolling_panda.messages.types import Answer
from rolling_panda.reasons import said
from tests.support.fake_wire import HEADER, FakeWire, controller_state, telling
from tests.support.running_server import running_server

#: What everybody who is signed in may do, and what everybody may do.
ANYBODY_SIGNED_IN = {"/api/stop", "/api/replay"}
PUBLIC = {"/api/sign-in", "/api/sign-out"}
SUPERVISOR = {"/api/reset", "/api/invite"}


@pytest.fixture(scope="module", params=["nothing is known", "all is refused"])
def server(request):
    """A role is refused before it is looked whether the robot, as it is, would let anybody do this."""
    wire = FakeWire()
    with running_server(wire) as running, telling(wire):
        if request.param == "all is refused":
            wire.answer = lambda request: Answer(ok=False, reason=said("as things are, nobody may"))
            wire.deliver(topics.CONTROLLER, controller_state(mode="ESTOP_LATCHED"))
            wire.deliver(topics.PREVIEW, PreviewState(header=HEADER, required=True, phase="expired"))
        yield running


def example(schema, document):
    """A body that fits a schema: the request must be refused for its role, not for its form."""
    if "$ref" in schema:
        return example(document["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]], document)
    if "enum" in schema:
        return schema["enum"][0]
    if "anyOf" in schema and "properties" not in schema:
        return example(schema["anyOf"][0], document)
    if "const" in schema:
        return schema["const"]
    match schema.get("type"):
        case "object":
            needed = schema.get("required", [])
            return {name: example(schema["properties"][name], document) for name in needed}
        case "array":
            parts = schema.get("prefixItems")
            return [0.5] * 4 if parts is None else [example(part, document) for part in parts]
        case "string":
            name = "p1" * max(1, -(-schema.get("minLength", 1) // 2))
            return next(word for word in (name, "0" * 64) if re.match(schema.get("pattern", ""), word))
        case "boolean":
            return True
        case "integer":
            return int(min(max(schema.get("minimum", 1), 1), schema.get("maximum", 1)))
        case _:
            return min(max(schema.get("minimum", 1), 1), schema.get("maximum", 1))


def posts(server):
    """(path, body) of every POST that the server describes."""
    with server.visitor() as visitor:
        document = visitor.get("/api/openapi.json").json()
    for path, methods in document["paths"].items():
        assert set(methods) <= {"get", "post"}, path
        if "post" in methods:
            content = methods["post"].get("requestBody", {}).get("content", {}).get("application/json", {})
            yield path, path.replace("{point_id}", "p1"), example(content.get("schema", {"type": "object"}), document)


@pytest.mark.parametrize("role", ["", "viewer", "operator", "supervisor"])
def test_a_role_may_do_what_it_may_and_nothing_else(server, role):
    seen = 0
    for path, url, body in posts(server):
        if path in PUBLIC:
            continue
        with server.client(role=role or "viewer", user="ann") as client:
            if not role:
                client.cookies.clear()
            server.wire.asked.clear()
            status = client.post(url, json=body).status_code
        allowed = bool(role) and (
            path in ANYBODY_SIGNED_IN or role == "supervisor" or (role == "operator" and path not in SUPERVISOR)
        )
        if not role:
            assert status == 401, path
        elif allowed:
            assert status not in (401, 403, 422), f"{path}: {status} {body}"
        else:
            assert status == 403, f"{path}: {status} for a {role}"
            assert server.wire.asked == [], path
        seen += 1
    assert seen >= 12
