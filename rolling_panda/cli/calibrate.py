"""`rolling-panda calibrate`: the board to print, and the calibrations of camera, base and arm by it.

The robot is moved by the running program with all of its checks, as by a press of a button on the page. This command
asks for it as a script does, watches, and shows the result.
"""

import argparse
import contextlib
import getpass
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from rolling_panda.errors import InputError, ServiceError

#: Time between looks at the robot, for the state to show that it has begun, time limits of a calibration, and for the
#: state to show that it is in use (s).
_POLL_S, _BEGUN_S, _LIMIT_S, _USED_S = 0.3, 3.0, 600.0, 5.0
_DPI, _SQUARE_PX = 600, 240
_BASE_QUESTION = (
    "Is the board 45 cm before the camera in its survey posture, the ground firm, and half a metre free before and "
    "behind the base? It will drive and turn."
)
_ARM_QUESTION = (
    "Is the board 45 cm before the camera in its survey posture, and nobody near the arm? It will move, with its elbow."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What can be calibrated, and the board."""
    kinds = parser.add_subparsers(dest="kind", metavar="WHAT", required=True)
    board = kinds.add_parser("board", help="write the board as a PNG to print on A4 in its own size")
    board.add_argument("--out", type=Path, default=Path("board.png"), help="file (default: %(default)s)")
    camera = kinds.add_parser("camera", help="look at the board from all around, and place the camera on the arm by it")
    base = kinds.add_parser("base", help="drive and turn before the board, and measure the wheels by it")
    arm = kinds.add_parser(
        "arm", help="look at the board with many postures of the arm, and measure the zeros of its joints by it"
    )
    for kind in (camera, base, arm):
        kind.add_argument(
            "page",
            help="a sign-in link of the page, which Invite makes and the demo prints; with --user its address alone",
        )
        kind.add_argument("--user", help="sign in by name and password in place of a link")
        kind.add_argument("--yes", action="store_true", help="move, and use the result, without asking")


def run(arguments: argparse.Namespace) -> int:
    """Run the command; returns 0 when a board was written or a calibration is in use, 1 without.

    Raises:
        InputError: The board cannot be written, or the link is none.
        ServiceError: The page does not answer, or refuses.
    """
    if arguments.kind == "board":
        return _write_board(arguments.out)
    return _calibrate_camera(arguments) if arguments.kind == "camera" else _calibrate_part(arguments, arguments.kind)


def _write_board(out: Path) -> int:
    from PIL import Image

    from rolling_panda.calibration.board import COLUMNS, MARGIN, ROWS, SQUARE, picture

    pixels = round(SQUARE / 0.0254 * _DPI)
    try:
        Image.fromarray(picture(pixels)).save(out, dpi=(pixels / SQUARE * 0.0254,) * 2)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot write the board to {out}: {error}; give a file that ends with .png") from error
    size = [1e3 * (count * SQUARE + 2 * MARGIN) for count in (COLUMNS, ROWS)]
    print(
        f"{out}: {size[0]:.0f} by {size[1]:.0f} mm. Print it at 100 %, glue it on a flat plate, and measure a square:"
    )
    print(f"it must be {1e3 * SQUARE:.0f} mm wide. A wrong size is a wrong calibration.")
    return 0


def _calibrate_camera(arguments: argparse.Namespace) -> int:
    with _Page(arguments.page, arguments.user) as page:
        print(f"In use: {_told(page.get('camera')['mount'])}")
        question = "Is the board 45 cm before the camera in its survey posture, and nobody near the arm? It will move."
        offer = _measured(page, arguments.yes, question, "camera", ("camera", "views", "offer", "refused"))
        if offer is None:
            return 1
        print(f"New:    {_told(offer)}")
        if not arguments.yes and not _agreed("Use it? All points are then looked for anew."):
            return 1
        print(page.post("camera/use", {"made_at": offer["made_at"]}))
    return 0


def _calibrate_part(arguments: argparse.Namespace, part: str) -> int:
    """Base or arm, whose calibration the bridge uses."""
    told, question = (_wheels_told, _BASE_QUESTION) if part == "base" else (_joints_told, _ARM_QUESTION)
    with _Page(arguments.page, arguments.user) as page:
        print(f"In use: {told((page.get('state')['bridge'] or {}).get(part))}")
        offer = _measured(
            page, arguments.yes, question, part, ("calibration", f"{part}_views", part, f"{part}_refused")
        )
        if offer is None:
            return 1
        print(f"New:    {told(offer)}")
        also = " The camera's place by the same pictures too: all points are then looked for anew." * (part == "arm")
        if not arguments.yes and not _agreed(f"Use it?{also}"):
            return 1
        page.post(f"{part}/use", {"made_at": offer["made_at"]})
        if not page.waits_for(lambda: (page.get("state")["bridge"] or {}).get(part) == offer):
            print(f"It is not in use: {page.newest_event()}")
            return 1
        print("It is in use.")
        return _use_its_camera(page, offer) if part == "arm" else 0


def _use_its_camera(page: "_Page", arm: dict[str, Any]) -> int:
    """Use the camera that was measured together with the arm, once perception sees the arm's new angles."""

    def mount() -> dict[str, Any] | None:
        offer: dict[str, Any] | None = page.get("camera")["offer"]
        return offer if offer is not None and offer["joint_offsets"] == arm["offsets"] else None

    if not page.waits_for(lambda: mount() is not None) or (found := mount()) is None:
        print("The camera's calibration does not fit the arm any more: calibrate the camera.")
        return 1
    print(f"Camera: {_told(found)}")
    print(page.post("camera/use", {"made_at": found["made_at"]}))
    return 0


def _measured(
    page: "_Page", yes: bool, question: str, what: str, names: tuple[str, str, str, str]
) -> dict[str, Any] | None:
    """Let the robot calibrate `what`; returns the calibration that it offers, None without one.

    Args:
        page: Session with the server.
        yes: Whether nothing is asked.
        question: Asked before anything moves.
        what: Calibrated part: `camera`, `base` or `arm`.
        names: Path of the state, and in it the number of views, the offer and why there is none.
    """
    path, views, offered, refused = names
    if not yes and not _agreed(question):
        return None
    if page.mode() == "IDLE":
        page.post("arm")
    page.post(f"{what}/calibrate")
    mode = page.watch(lambda: int(page.get(path)[views]))
    print(f"\n{page.newest_event()}")
    result = page.get(path)
    offer: dict[str, Any] | None = result[offered]
    if mode == "READY" and offer is not None:
        return offer
    print(f"No calibration: {page.words(result[refused])}" if result[refused] else "No calibration.")
    print("The calibration in use stays as it is.")
    return None


def _wheels_told(base: dict[str, Any] | None) -> str:
    if base is None:
        return "the wheels are taken to be as drawn"
    made = time.strftime("%Y-%m-%d %H:%M", time.localtime(base["made_at"]))
    return (
        f"{made}, {base['views']} views: radius {1e3 * base['left']:.2f} and {1e3 * base['right']:.2f} mm, track "
        f"{1e3 * base['track']:.2f} mm; standard deviation {100 * base['radius_sd']:.2f} % and "
        f"{100 * base['track_sd']:.2f} %; slip {100 * base['slip']:.2f} %"
    )


def _joints_told(arm: dict[str, Any] | None) -> str:
    if arm is None:
        return "the zeros of the arm's joints are taken to be as drawn"
    made = time.strftime("%Y-%m-%d %H:%M", time.localtime(arm["made_at"]))
    offsets = ", ".join(f"{math.degrees(offset):.3f}" for offset in arm["offsets"][1:6])
    return (
        f"{made}, {arm['views']} views: joints 2 to 6 off by {offsets} degrees; standard deviation "
        f"{math.degrees(arm['offset_sd']):.3f} degrees; error {arm['pixels']:.2f} px"
    )


def _told(mount: dict[str, Any] | None) -> str:
    if mount is None:
        return "the camera is taken to be where it is drawn"
    made = time.strftime("%Y-%m-%d %H:%M", time.localtime(mount["made_at"]))
    return (
        f"{made}, {mount['views']} views by {mount['source']}: error {mount['pixels']:.2f} px; "
        f"standard deviation {math.degrees(mount['angle_sd']):.3f} degrees, {1e3 * mount['shift_sd']:.2f} mm; "
        f"focal length x {mount['focal']:.4f}"
    )


def _agreed(question: str) -> bool:
    return input(f"{question} [y/N] ").strip().lower() in ("y", "yes")


class _Page:
    """A session with the page's server."""

    def __init__(self, link: str, user: str | None) -> None:
        parts = urlsplit(link)
        tokens = parse_qs(parts.query).get("token", [])
        if not parts.scheme.startswith("http") or (not tokens and user is None):
            raise InputError(f"{link!r} is no sign-in link; copy it from Invite on the page, or give --user NAME")
        # No other command needs it, and it takes as long to import as the rest.
        import httpx

        self._unanswered = httpx.HTTPError
        address = f"{parts.scheme}://{parts.netloc}"
        self._client = httpx.Client(base_url=address, headers={"Origin": address}, timeout=10.0, trust_env=False)
        body = {"token": tokens[0]} if user is None else {"user": user, "password": getpass.getpass()}
        self.post("sign-in", body)

    def __enter__(self) -> "_Page":
        return self

    def __exit__(self, *_: object) -> None:
        """Give up control, so that whoever comes next need not wait for it to lapse."""
        with contextlib.suppress(self._unanswered):
            self._client.post("/api/control/return")
        self._client.close()

    def get(self, what: str) -> Any:
        """What `/api/…` tells."""
        return self._ask("GET", what)

    def post(self, what: str, body: dict[str, Any] | None = None) -> str:
        """Ask for something; returns what the robot says to it."""
        return str(self._ask("POST", what, body).get("reason", ""))

    def mode(self) -> str:
        """Mode of the robot."""
        controller = self.get("state")["controller"]
        if controller is None:
            raise ServiceError("the controller has not reported; is it running?")
        return str(controller["mode"])

    def waits_for(self, condition: Callable[[], bool]) -> bool:
        """Whether a condition comes true soon."""
        end = time.monotonic() + _USED_S
        while not (met := condition()) and time.monotonic() < end:
            time.sleep(_POLL_S)
        return met

    def watch(self, views: Callable[[], int]) -> str:
        """Watch the robot until its work has ended; returns its mode then. Ctrl-C pauses it.

        Args:
            views: Counts the pictures of the board.
        """
        begun, start = False, time.monotonic()
        try:
            while time.monotonic() - start < _LIMIT_S:
                time.sleep(_POLL_S)
                mode = self.mode()
                print(f"\r{views()} views of the board", end="", flush=True)
                begun = begun or mode == "AUTO"
                if mode != "AUTO" and (begun or time.monotonic() - start > _BEGUN_S):
                    return mode
        except KeyboardInterrupt:
            self.post("pause")
            raise
        self.post("pause")
        raise ServiceError(f"the calibration has not ended within {_LIMIT_S:.0f} s; the robot was paused")

    def newest_event(self) -> str:
        """The newest line of the robot's log."""
        events = self.get("events")["events"]
        return str(events[-1]["text"]) if events else ""

    def words(self, reason: dict[str, Any]) -> str:
        """A reason in English."""
        import msgspec

        from rolling_panda.messages.types import Reason
        from rolling_panda.reasons import text_of

        return text_of(msgspec.convert(reason, Reason))

    def _ask(self, method: str, what: str, body: dict[str, Any] | None = None) -> Any:
        try:
            answer = self._client.request(method, f"/api/{what}", json=body)
        except self._unanswered as error:
            raise ServiceError(f"the page does not answer: {error}; is the address right?") from error
        if answer.is_success:
            return answer.json() if answer.content else {}
        told = (
            answer.json().get("reason", answer.text)
            if "json" in answer.headers.get("content-type", "")
            else answer.text
        )
        raise ServiceError(f"{what} was refused: {told}")
