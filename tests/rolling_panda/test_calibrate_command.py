"""`rolling-panda calibrate`: the board as a file, and camera, base and arm through a page that is played."""

import functools
import json
from pathlib import Path

import httpx
import msgspec
import numpy as np
import pytest
from PIL import Image

from rolling_panda import reasons
from rolling_panda.calibration.board import COLUMNS, MARGIN, ROWS, SQUARE
from rolling_panda.cli import calibrate
from rolling_panda.cli.main import main

LINK = "http://panda.test:8000/sign-in?token=abc"
OFFER = {
    "made_at": 1.8e9,
    "views": 25,
    "source": "board",
    "pixels": 0.1,
    "angle_sd": 1e-4,
    "shift_sd": 1e-4,
    "focal": 1.0,
}


WHEELS: dict[str, object] = {
    "made_at": 1.8e9,
    "views": 33,
    "left": 0.1325,
    "right": 0.1326,
    "track": 0.511,
    "radius_sd": 0.001,
    "apart_sd": 0.001,
    "track_sd": 0.002,
    "slip": 0.003,
}


OFFSETS = [0.0, 0.01, -0.002, 0.003, 0.0, 0.005, 0.0]
JOINTS: dict[str, object] = {"made_at": 1.7e9, "views": 25, "offsets": OFFSETS, "offset_sd": 2e-5, "pixels": 0.1}


class PlayedPage:
    """The page's server. `modes` are told one after another, the last one for ever."""

    def __init__(self) -> None:
        self.modes = ["READY", "READY", "AUTO", "AUTO", "READY"]
        self.offer: dict[str, object] | None = OFFER
        self.refused: dict[str, object] | None = None
        self.refusal: dict[str, int] = {}
        self.interrupts = False
        self.base: dict[str, object] | None = None
        self.base_offer: dict[str, object] | None = WHEELS
        self.base_refused: dict[str, object] | None = None
        self.arm: dict[str, object] | None = None
        self.arm_offer: dict[str, object] | None = JOINTS
        self.arm_refused: dict[str, object] | None = None
        self.posted: list[tuple[str, object]] = []
        self.given_back = 0

    def answer(self, request: httpx.Request) -> httpx.Response:
        path = request.url.path.removeprefix("/api/")
        if path == "control/return":
            self.given_back += 1
        elif request.method == "POST":
            self.posted.append((path, json.loads(request.content) if request.content else None))
            if path == "base/use" and path not in self.refusal:
                self.base = self.base_offer
            if path == "arm/use" and path not in self.refusal:
                self.arm = self.arm_offer
            return httpx.Response(self.refusal.get(path, 200), json={"reason": f"{path} is told"})
        if path == "state":
            if self.interrupts and ("camera/calibrate", None) in self.posted and ("pause", None) not in self.posted:
                raise KeyboardInterrupt
            mode = self.modes[0] if len(self.modes) == 1 else self.modes.pop(0)
            return httpx.Response(
                200, json={"controller": {"mode": mode}, "bridge": {"base": self.base, "arm": self.arm}}
            )
        if path == "camera":
            return httpx.Response(200, json={"mount": None, "views": 7, "offer": self.offer, "refused": self.refused})
        if path == "calibration":
            found = {"base_views": 33, "base": self.base_offer, "base_refused": self.base_refused}
            found |= {"arm_views": 25, "arm": self.arm_offer, "arm_refused": self.arm_refused}
            return httpx.Response(200, json=found)
        return httpx.Response(200, json={"events": [{"text": "25 of 25 pictures show the board"}]})


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> PlayedPage:
    played = PlayedPage()
    transport = httpx.MockTransport(played.answer)
    monkeypatch.setattr(httpx, "Client", functools.partial(httpx.Client, transport=transport))
    monkeypatch.setattr(calibrate, "_POLL_S", 0.0)
    monkeypatch.setattr(calibrate, "_USED_S", 0.01)
    return played


def test_the_board_prints_in_its_own_size(tmp_path: Path) -> None:
    out = tmp_path / "board.png"
    assert main(["calibrate", "board", "--out", str(out)]) == 0
    with Image.open(out) as image:
        size_m = np.array(image.size) / np.array(image.info["dpi"]) * 0.0254
    assert size_m == pytest.approx([COLUMNS * SQUARE + 2 * MARGIN, ROWS * SQUARE + 2 * MARGIN], abs=2e-4)


def test_a_board_that_cannot_be_written_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "board", "--out", str(tmp_path / "nowhere" / "board.png")]) != 0
    assert "cannot write the board" in capsys.readouterr().err


def test_the_camera_is_calibrated_and_the_result_used(page: PlayedPage, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "camera", LINK, "--yes"]) == 0
    assert page.posted == [
        ("sign-in", {"token": "abc"}),
        ("camera/calibrate", None),
        ("camera/use", {"made_at": 1.8e9}),
    ]
    assert page.given_back == 1
    told = capsys.readouterr().out
    assert "the camera is taken to be where it is drawn" in told and "25 views by board" in told


def test_an_idle_robot_is_armed_first(page: PlayedPage) -> None:
    page.modes[0] = "IDLE"
    assert main(["calibrate", "camera", LINK, "--yes"]) == 0
    assert [path for path, _ in page.posted] == ["sign-in", "arm", "camera/calibrate", "camera/use"]


def test_without_a_yes_nothing_moves_and_without_a_second_one_the_old_calibration_stays(
    page: PlayedPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("builtins.input", lambda _: "n")
    assert main(["calibrate", "camera", LINK]) == 1
    assert [path for path, _ in page.posted] == ["sign-in"]
    answers = iter(("y", ""))
    monkeypatch.setattr("builtins.input", lambda _: next(answers))
    assert main(["calibrate", "camera", LINK]) == 1
    assert "camera/use" not in [path for path, _ in page.posted]


def test_a_refused_calibration_says_why_and_is_not_used(page: PlayedPage, capsys: pytest.CaptureFixture[str]) -> None:
    page.offer, page.refused = None, msgspec.to_builtins(reasons.calibration_few_views(4, 10))
    assert main(["calibrate", "camera", LINK, "--yes"]) == 1
    told = capsys.readouterr().out
    assert reasons.text_of(reasons.calibration_few_views(4, 10)) in told and "stays as it is" in told
    assert "camera/use" not in [path for path, _ in page.posted]


def test_a_pause_leaves_the_old_calibration(page: PlayedPage) -> None:
    page.modes = ["READY", "AUTO", "PAUSED"]
    assert main(["calibrate", "camera", LINK, "--yes"]) == 1
    assert "camera/use" not in [path for path, _ in page.posted]


def test_ctrl_c_pauses_the_robot(page: PlayedPage) -> None:
    page.interrupts = True
    with pytest.raises(KeyboardInterrupt):
        main(["calibrate", "camera", LINK, "--yes"])
    assert page.posted[-1] == ("pause", None) and page.given_back == 1


def test_what_the_page_refuses_is_told(page: PlayedPage, capsys: pytest.CaptureFixture[str]) -> None:
    page.refusal = {"camera/calibrate": 409}
    assert main(["calibrate", "camera", LINK, "--yes"]) != 0
    assert "camera/calibrate is told" in capsys.readouterr().err


@pytest.mark.parametrize("link", ["board", "http://panda.test:8000/", "ftp://panda.test/sign-in?token=abc"])
def test_a_link_that_signs_nobody_in_is_an_error(link: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "camera", link, "--yes"]) != 0
    assert "is no sign-in link" in capsys.readouterr().err


def test_a_page_that_does_not_answer_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "camera", "http://127.0.0.1:9/sign-in?token=abc", "--yes"]) != 0
    assert "the page does not answer" in capsys.readouterr().err


def test_the_base_is_calibrated_and_the_result_used(page: PlayedPage, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "base", LINK, "--yes"]) == 0
    assert page.posted == [
        ("sign-in", {"token": "abc"}),
        ("base/calibrate", None),
        ("base/use", {"made_at": 1.8e9}),
    ]
    told = capsys.readouterr().out
    assert "taken to be as drawn" in told and "radius 132.50 and 132.60 mm, track 511.00 mm" in told


def test_a_refused_calibration_of_the_base_says_why(page: PlayedPage, capsys: pytest.CaptureFixture[str]) -> None:
    page.base_offer, page.base_refused = None, msgspec.to_builtins(reasons.base_slipped(2.5, 1.0))
    assert main(["calibrate", "base", LINK, "--yes"]) == 1
    told = capsys.readouterr().out
    assert reasons.text_of(reasons.base_slipped(2.5, 1.0)) in told and "stays as it is" in told
    assert "base/use" not in [path for path, _ in page.posted]


def test_a_base_that_the_bridge_does_not_take_is_no_success(
    page: PlayedPage, capsys: pytest.CaptureFixture[str]
) -> None:
    page.refusal = {"base/use": 200}
    assert main(["calibrate", "base", LINK, "--yes"]) == 1
    assert "not in use" in capsys.readouterr().out


def test_without_a_yes_the_base_does_not_move(page: PlayedPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("builtins.input", lambda _: "n")
    assert main(["calibrate", "base", LINK]) == 1
    assert [path for path, _ in page.posted] == ["sign-in"]


def test_the_arm_is_calibrated_and_the_camera_that_was_measured_with_it_used_too(
    page: PlayedPage, capsys: pytest.CaptureFixture[str]
) -> None:
    page.offer = OFFER | {"joint_offsets": OFFSETS}
    assert main(["calibrate", "arm", LINK, "--yes"]) == 0
    assert page.posted == [
        ("sign-in", {"token": "abc"}),
        ("arm/calibrate", None),
        ("arm/use", {"made_at": 1.7e9}),
        ("camera/use", {"made_at": 1.8e9}),
    ]
    told = capsys.readouterr().out
    assert "taken to be as drawn" in told and "joints 2 to 6 off by 0.573, -0.115, 0.172, 0.000, 0.286 degrees" in told


def test_an_arm_whose_camera_is_not_offered_says_that_the_camera_has_to_be_calibrated(
    page: PlayedPage, capsys: pytest.CaptureFixture[str]
) -> None:
    page.offer = OFFER | {"joint_offsets": [0.0] * 7}
    assert main(["calibrate", "arm", LINK, "--yes"]) == 1
    assert "calibrate the camera" in capsys.readouterr().out
    assert page.posted[-1] == ("arm/use", {"made_at": 1.7e9}), "a camera of other joints is not used"


def test_a_refused_calibration_of_the_arm_says_why(page: PlayedPage, capsys: pytest.CaptureFixture[str]) -> None:
    page.arm_offer, page.arm_refused = None, msgspec.to_builtins(reasons.arm_far(3, 2.4, 2.0))
    assert main(["calibrate", "arm", LINK, "--yes"]) == 1
    told = capsys.readouterr().out
    assert reasons.text_of(reasons.arm_far(3, 2.4, 2.0)) in told and "stays as it is" in told
    assert [path for path, _ in page.posted] == ["sign-in", "arm/calibrate"]


def test_an_arm_that_the_bridge_does_not_take_is_no_success(
    page: PlayedPage, capsys: pytest.CaptureFixture[str]
) -> None:
    page.refusal = {"arm/use": 200}
    assert main(["calibrate", "arm", LINK, "--yes"]) == 1
    assert "not in use" in capsys.readouterr().out and page.posted[-1][0] == "arm/use"
