"""What the server relies on in viser beyond its public interface, checked when a view server starts.

Each assumption names the attribute or the behaviour, and what breaks without it. No other file names a private module.
"""

import dataclasses
import importlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

import viser

from rolling_panda.errors import RollingPandaError
from server.scene.viser_adapter.client_messages import CLIENT_MESSAGES

#: The version that `pyproject.toml` names, with which the assumptions were tested.
TESTED_VERSION = "1.1.1"
#: The installed version.
VERSION = str(viser.__version__)
#: The start of viser's client in its page.
CLIENT_START = b"await init();"
#: Where that page has unpacked the client's script.
CLIENT_SCRIPT = b"const code=td.decode(heap.subarray(up+ss,up+sz));"


class ViserChangedError(RollingPandaError):
    """Viser is not as the server needs it."""


@dataclass(frozen=True)
class Assumption:
    """Something of viser that is not in its public interface.

    Attributes:
        name: The attribute, with its class or module, or the behaviour.
        breaks: What does not work without it.
        holds: Whether it is so in a running viser server. An `AttributeError` counts as no.
    """

    name: str
    breaks: str
    holds: Callable[[viser.ViserServer], bool]


def _module(name: str, breaks: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise _changed(name, breaks) from error


def _changed(name: str, breaks: str) -> ViserChangedError:
    return ViserChangedError(
        f"viser {VERSION} lacks {name}, or it has changed: without it {breaks}. The server was tested with viser "
        f"{TESTED_VERSION}: install that version, or adapt server/scene/viser_adapter."
    )


#: Viser's private modules: its messages, and the buffers of outgoing messages.
messages: Any = _module("viser._messages", "the messages between server and browser are unknown")
buffers: Any = _module("viser.infra._async_message_buffer", "many open views end the server")


def client_page() -> bytes:
    """The page of viser's client: one self-contained HTML file."""
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()


def _attribute(path: str, breaks: str) -> Assumption:
    """An attribute of the running server, by its path."""

    def holds(server: viser.ViserServer) -> bool:
        attrgetter(path)(server)
        return True

    return Assumption(f"ViserServer.{path}", breaks, holds)


def _message(name: str, fields: tuple[str, ...], breaks: str) -> Assumption:
    """A message with exactly these fields."""

    def holds(_: viser.ViserServer) -> bool:
        return {field.name for field in dataclasses.fields(getattr(messages, name))} == set(fields)

    return Assumption(f"viser._messages.{name}{fields}", breaks, holds)


def _sets_event(_: viser.ViserServer) -> bool:
    return "message_event" in {field.name for field in dataclasses.fields(buffers.AsyncMessageBuffer)}


def _takes_client(_: viser.ViserServer) -> bool:
    return [*inspect.signature(buffers.AsyncMessageBuffer.window_generator).parameters][:2] == ["self", "client_id"]


def _starts_once(_: viser.ViserServer) -> bool:
    page = client_page()
    return page.count(CLIENT_START) == 1 and page.count(b"<head>") == 1


def _unpacks_once(_: viser.ViserServer) -> bool:
    return client_page().count(CLIENT_SCRIPT) == 1


def _keeps_pose(server: viser.ViserServer) -> bool:
    handle = server.scene.add_frame("/contract", show_axes=False)
    try:
        handle.position[:], handle.wxyz[:] = (1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0)
        return [*handle.position, *handle.wxyz] == [1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.0]
    finally:
        handle.remove()


_SERVER = "_websock_server"
_BUFFER = f"{_SERVER}._broadcast_buffer"
_REFUSAL = "connections that do not come through the page cannot be refused"
_RATE = "viewers' views cannot be updated less often, and dozens of them delay the view that moves the robot"

ASSUMPTIONS: tuple[Assumption, ...] = (
    _attribute(_SERVER, _REFUSAL),
    _attribute(f"{_SERVER}._live_connections", _REFUSAL),
    _attribute(f"{_SERVER}.on_client_connect", _REFUSAL),
    _attribute(f"{_SERVER}.on_client_disconnect", "the owners of closed views stay in memory"),
    _attribute(f"{_SERVER}.unregister_handler", "a browser can publish the view through a public tunnel"),
    _attribute(_BUFFER, _RATE),
    _attribute(f"{_BUFFER}.max_window_size", _RATE),
    Assumption("AsyncMessageBuffer.window_generator(client_id)", _RATE, _takes_client),
    Assumption("AsyncMessageBuffer.message_event", "dozens of open views end the server", _sets_event),
    _message("ShareUrlRequest", (), "a browser can publish the view through a public tunnel"),
    _message("ShareUrlDisconnect", (), "a browser can publish the view through a public tunnel"),
    _message("SetSceneNodeVisibilityMessage", ("name", "visible", "owner"), "a session cannot choose its layers"),
    Assumption(
        f"one {CLIENT_START.decode()!r} in client/build/index.html",
        "the 3-D client starts before its rendering is configured",
        _starts_once,
    ),
    Assumption(
        f"one {CLIENT_SCRIPT.decode()!r} in client/build/index.html",
        "the wheel zooms into the middle of the view instead of towards the pointer",
        _unpacks_once,
    ),
    Assumption(
        "handle.position[:] and handle.wxyz[:] change what viser believes to be drawn",
        "a released gizmo is not drawn back at the tool",
        _keeps_pose,
    ),
    *(
        _message(
            str(each.__struct_config__.tag),
            tuple(each.__struct_fields__),
            "the filter drops what the view's user does",
        )
        for each in CLIENT_MESSAGES
    ),
)


def check(server: viser.ViserServer) -> None:
    """Check every assumption.

    Raises:
        ViserChangedError: One does not hold; names it, the tested version, and what breaks.
    """
    for assumption in ASSUMPTIONS:
        try:
            holds = assumption.holds(server)
        except (AttributeError, TypeError):
            holds = False
        if not holds:
            raise _changed(assumption.name, assumption.breaks)
