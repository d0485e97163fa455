"""Base and joints by hand on the page: keys, the pad, a gamepad, and what ends each hold."""

import math
from typing import Any

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.messages.supervision import SavedPosture
from rolling_panda.reasons import text_of
from tests.support.page_parts import open_screen
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, controller

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "drive"


GAMEPAD = """
window.pad = { connected: true, index: 0, id: "Test pad", mapping: "standard",
  axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ value: 0, pressed: false })) };
navigator.getGamepads = () => [window.pad];
"""


def holds(server: PlayedServer) -> list[p.Hold]:
    return [message for message in server.said if isinstance(message, p.Hold)]


def newest(server: PlayedServer) -> p.Hold | None:
    return holds(server)[-1] if holds(server) else None


def held(server: PlayedServer) -> bool:
    hold = newest(server)
    return hold is not None and hold.hold


def said_as(why: m.Reason) -> dict[str, Any]:
    """A reason as an answer of the server has it."""
    return {"code": why.code, "values": dict(why.values)}


def begin(page: Page, part: str) -> None:
    page.locator("#teleop").click()
    page.get_by_role("button", name=part, exact=True).click()


def middle(page: Page, selector: str) -> tuple[float, float]:
    box = box_of(page.locator(selector))
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_what_moves_and_along_which_axes_is_chosen(page: Page, server: PlayedServer) -> None:
    expect(page.get_by_role("group", name="What moves")).to_be_hidden()
    page.locator("#teleop").click()
    page.get_by_role("button", name="row", exact=True).click()
    until(page, lambda: p.ShowGizmo(visible=True, axes="world") in server.said)
    page.get_by_role("button", name="Base", exact=True).click()
    until(page, lambda: p.ShowGizmo(visible=False, axes="world") in server.said)
    expect(page.locator("#hold")).to_be_hidden()
    page.get_by_role("group", name="What moves").get_by_role("button", name="Tool", exact=True).click()
    expect(page.get_by_role("button", name="row", exact=True)).to_have_attribute("aria-pressed", "true")
    until(page, lambda: server.said.count(p.ShowGizmo(visible=True, axes="world")) == 2)


def test_keys_drive_the_base_while_they_are_down(page: Page, server: PlayedServer) -> None:
    page.keyboard.down("w")
    page.keyboard.up("w")
    begin(page, "Base")
    assert holds(server) == [], "a letter means nothing before the base is what moves"
    page.keyboard.down("w")
    until(page, lambda: held(server))
    hold = newest(server)
    assert hold is not None and hold.base is not None
    assert hold.base.linear > 0.1 and hold.base.angular == 0.0
    page.keyboard.down("ArrowLeft")
    until(page, lambda: (newest(server) or hold).base.angular > 0.1)  # type: ignore[union-attr]
    page.keyboard.up("w")
    until(page, lambda: (newest(server) or hold).base.linear == 0.0)  # type: ignore[union-attr]
    page.keyboard.up("ArrowLeft")
    until(page, lambda: not held(server))
    count = len(holds(server))
    page.keyboard.press("h")
    page.wait_for_timeout(150)
    assert len(holds(server)) == count, "H leads the tool, which is not what moves now"


def test_leaving_the_window_ends_the_drive_and_the_key_that_is_still_down_goes_on_with_nothing(
    page: Page, server: PlayedServer
) -> None:
    begin(page, "Base")
    page.keyboard.down("s")
    until(page, lambda: held(server))
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    until(page, lambda: not held(server))
    count = len(holds(server))
    page.wait_for_timeout(150)
    assert len(holds(server)) == count


def test_the_pad_drives_as_far_as_it_is_drawn_and_a_second_finger_ends_it(page: Page, server: PlayedServer) -> None:
    begin(page, "Base")
    x, y = middle(page, "#drive-pad")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 42)
    until(page, lambda: held(server) and newest(server).base.linear > 0.15)  # type: ignore[union-attr]
    page.mouse.move(x, y - 200)
    until(page, lambda: newest(server).base.linear == pytest.approx(0.4))  # type: ignore[union-attr]
    page.locator("h1").dispatch_event("pointerdown", {"pointerId": 77, "isPrimary": False})
    until(page, lambda: not held(server))
    count = len(holds(server))
    page.mouse.move(x + 20, y)
    page.wait_for_timeout(150)
    assert len(holds(server)) == count, "the finger that is still down drives no more"
    page.mouse.up()


def test_a_gamepad_drives_while_its_trigger_is_held(page: Page, server: PlayedServer) -> None:
    page.evaluate(GAMEPAD)
    page.evaluate("pad.buttons[7] = { value: 1 }")
    begin(page, "Base")
    page.wait_for_timeout(200)
    assert holds(server) == [], "a trigger that was held before counts only when it is pulled anew"
    expect(page.locator("rp-drive-pad")).to_contain_text("hold a trigger")
    page.evaluate("pad.buttons[7] = { value: 0 }")
    page.wait_for_timeout(120)
    page.evaluate("pad.axes = [0.05, -0.5, 0, 0]; pad.buttons[7] = { value: 1 }")
    until(page, lambda: held(server))
    hold = newest(server)
    assert hold is not None and hold.base is not None
    assert (hold.base.linear, hold.base.angular) == (pytest.approx(0.2), 0.0), (
        "a stick's rest is not zero, but means it"
    )
    page.evaluate("pad.buttons[7] = { value: 0 }")
    until(page, lambda: not held(server))


def test_a_gamepad_that_is_unplugged_ends_the_hold(page: Page, server: PlayedServer) -> None:
    page.evaluate(GAMEPAD)
    begin(page, "Base")
    page.wait_for_timeout(120)
    page.evaluate("pad.axes = [0, -1, 0, 0]; pad.buttons[6] = { value: 1 }")
    until(page, lambda: held(server))
    page.evaluate("pad.connected = false; window.dispatchEvent(new Event('gamepaddisconnected'))")
    until(page, lambda: not held(server))
    page.evaluate("pad.connected = true")
    page.wait_for_timeout(200)
    assert not held(server), "plugged in again, the trigger has to be pulled anew"


def test_a_joint_turns_while_its_button_is_held_and_its_range_is_drawn(page: Page, server: PlayedServer) -> None:
    begin(page, "Joints")
    joints = page.locator("rp-joints .joint")
    expect(joints).to_have_count(7)
    expect(joints.nth(3).locator(".scale")).to_have_attribute("title", "-166° to 166°")
    page.locator("#speed-scale").fill("30")
    page.mouse.move(*middle(page, '[aria-label="Joint 4 down"]'))
    page.mouse.down()
    until(page, lambda: held(server))
    hold = newest(server)
    assert hold is not None and hold.joints is not None
    assert [joint for joint, speed in enumerate(hold.joints, 1) if speed] == [4] and hold.joints[3] < 0.0
    assert hold.speed_scale == pytest.approx(0.3)
    page.mouse.up()
    until(page, lambda: not held(server))
    for button in page.locator("rp-joints button").all():
        box = box_of(button)
        assert min(box["width"], box["height"]) >= 44


@pytest.mark.long
def test_the_next_joint_turns_for_as_long_as_its_button_is_held_too(page: Page, server: PlayedServer) -> None:
    begin(page, "Joints")
    for name, joint in (("Joint 1 up", 1), ("Joint 4 up", 4)):
        page.mouse.move(*middle(page, f'[aria-label="{name}"]'))
        page.mouse.down()
        until(page, lambda: held(server))
        page.wait_for_timeout(300)
        hold = newest(server)
        assert hold is not None and hold.hold and hold.joints is not None, name
        assert hold.joints[joint - 1] > 0.0
        page.mouse.up()
        until(page, lambda: not held(server))


def test_two_at_once_stop_and_say_so(page: Page, server: PlayedServer) -> None:
    begin(page, "Joints")
    expect(page.locator('[aria-label="Joint 1 up"]')).to_be_visible()
    page.locator('[aria-label="Joint 1 up"]').focus()
    page.keyboard.down("Enter")
    until(page, lambda: held(server))
    page.mouse.move(*middle(page, '[aria-label="Joint 2 up"]'))
    page.mouse.down()
    until(page, lambda: not held(server))
    page.mouse.up()
    page.keyboard.up("Enter")


def test_while_somebody_holds_the_page_says_what_is_near_and_what_holds_the_robot(
    page: Page, server: PlayedServer
) -> None:
    page.locator("#teleop").click()
    page.locator("h1").click()
    page.keyboard.down("h")
    until(page, lambda: held(server))
    hint = page.locator(".drive-foot .hint")
    server.controller = controller("TELEOP", proximity=m.Proximity(0.048, "blades – wire 3"))
    expect(hint).to_have_text("48 mm between blades – wire 3.")
    server.controller = msgspec.structs.replace(server.controller, limited_by="joint 4")
    expect(hint).to_have_text("Held back by joint 4.")
    expect(hint).to_have_class("hint warned")
    page.keyboard.up("h")
    expect(hint).to_contain_text("drag the gizmo")


def test_in_a_mode_without_teleoperation_every_button_says_why(page: Page, server: PlayedServer) -> None:
    why = reasons.cause_recent(1.0)
    server.controller = controller("PAUSED", allowed={"Teleoperation": why})
    expect(page.locator("#teleop")).to_have_attribute("title", text_of(why))
    expect(page.locator("rp-joints")).to_be_hidden()


def test_a_controller_that_is_silent_for_a_moment_ends_the_hold_and_not_the_teleoperation(
    page: Page, server: PlayedServer
) -> None:
    begin(page, "Joints")
    up = page.get_by_role("button", name="Joint 2 up")
    up.hover()
    page.mouse.down()
    until(page, lambda: held(server))
    heard_s, server.heard_s = server.heard_s, 1.4
    until(page, lambda: not held(server))
    expect(page.locator("#teleop")).to_have_attribute("aria-disabled", "true")
    server.heard_s = heard_s
    expect(page.locator("#teleop")).to_have_attribute("aria-disabled", "false")
    expect(up).to_be_visible()
    assert not held(server)
    page.mouse.up()
    page.mouse.down()
    until(page, lambda: held(server))


# --- arrows beside the gizmo -----------------------------------------------------------------------------------------


def test_an_arrow_moves_the_tool_along_its_axis_while_it_is_held(page: Page, server: PlayedServer) -> None:
    page.locator("#teleop").click()
    page.get_by_role("button", name="row", exact=True).click()
    up = page.locator('.arrows button[data-axis="z"][data-kind="move"][data-way="1"]')
    expect(up).to_have_attribute("aria-label", "Move the tool forth: Up")
    up.hover()
    page.mouse.down()
    until(page, lambda: held(server))
    hold = newest(server)
    assert hold is not None and hold.along is not None and hold.base is None and hold.joints is None
    assert hold.along.axes == "world" and hold.along.linear[2] > 0.0 and hold.along.linear[:2] == (0.0, 0.0)
    assert hold.along.angular == (0.0, 0.0, 0.0) and hold.along.duration_s is None
    page.mouse.up()
    until(page, lambda: not held(server))


@pytest.mark.parametrize("ends", ["blur", "pointercancel", "hidden"])
def test_whatever_ends_a_hold_ends_an_arrow_too(page: Page, server: PlayedServer, ends: str) -> None:
    page.locator("#teleop").click()
    arrow = page.locator('.arrows button[data-axis="x"][data-kind="turn"][data-way="-1"]')
    arrow.hover()
    page.mouse.down()
    until(page, lambda: held(server))
    if ends == "blur":
        page.evaluate("window.dispatchEvent(new Event('blur'))")
    elif ends == "hidden":
        page.evaluate("Object.defineProperty(document, 'hidden', { get: () => true })")
        page.evaluate("document.dispatchEvent(new Event('visibilitychange'))")
    else:
        arrow.dispatch_event("pointercancel", {"pointerId": 1})
    until(page, lambda: not held(server))
    count = len(holds(server))
    page.wait_for_timeout(200)
    assert len(holds(server)) == count, "the finger that is still down moves nothing"
    page.mouse.up()


def test_a_step_says_how_far_one_press_goes(page: Page, server: PlayedServer) -> None:
    page.locator("#teleop").click()
    page.get_by_role("button", name="10 mm", exact=True).click()
    page.locator('.arrows button[data-axis="y"][data-kind="move"][data-way="-1"]').hover()
    page.mouse.down()
    until(page, lambda: held(server))
    hold = newest(server)
    assert hold is not None and hold.along is not None and hold.along.duration_s is not None
    assert hold.along.linear[1] * hold.along.duration_s == pytest.approx(-0.01)
    page.mouse.up()
    until(page, lambda: not held(server))


# --- angles to type, and postures ------------------------------------------------------------------------------------


def state_with_postures(server: PlayedServer) -> None:
    angles = (0.1, -0.2, 0.3, -2.0, 0.5, 1.2, 0.7)
    own, saved = SavedPosture("survey", angles), SavedPosture("Over the wire", angles[::-1], "Ada")
    server.controller = controller(postures=(own, saved))


def test_a_typed_angle_is_reached_only_while_the_button_is_held(page: Page, server: PlayedServer) -> None:
    begin(page, "Joints")
    expect(page.locator("#go")).to_be_disabled()
    page.locator(".joint .target").nth(3).fill("-90")
    until(page, lambda: any(path == "/api/postures/check" for path, _ in server.posted))
    expect(page.locator("#go")).to_have_text("Hold to go: Elbow -90°")
    expect(page.locator("#go")).to_be_enabled()
    assert holds(server) == [], "typing moves nothing"
    shown = [message for message in server.said if isinstance(message, p.ShowPosture)][-1]
    assert shown.angles is not None and shown.angles[3] == pytest.approx(-math.pi / 2)
    page.locator("#go").hover()
    page.mouse.down()
    until(page, lambda: held(server))
    hold = newest(server)
    assert hold is not None and hold.posture is not None and hold.posture[3] == pytest.approx(-math.pi / 2)
    page.mouse.up()
    until(page, lambda: not held(server))
    page.get_by_role("button", name="Base", exact=True).click()
    until(page, lambda: server.said[-1] is not None and p.ShowPosture(angles=None) in server.said)


@pytest.mark.parametrize(
    ("typed", "words"), [("abc", "Not a number: "), ("1e999", "Not a number: "), ("400", "cannot turn to 400.0°")]
)
def test_what_is_no_angle_of_the_joint_is_refused_with_the_reason(
    page: Page, server: PlayedServer, typed: str, words: str
) -> None:
    begin(page, "Joints")
    page.locator(".joint .target").nth(1).fill(typed)
    expect(page.locator(".drive-foot .hint")).to_contain_text(words)
    expect(page.locator("#go")).to_be_disabled()
    page.locator("#go").dispatch_event("pointerdown", {"button": 0, "pointerId": 1})
    page.wait_for_timeout(200)
    assert holds(server) == [] and not any(path == "/api/postures/check" for path, _ in server.posted)


def test_bar_and_refusal_name_the_range_that_the_controller_leaves(page: Page, server: PlayedServer) -> None:
    server.controller = controller(kept_margin=0.03)
    begin(page, "Joints")
    # 2.9 rad are 166.2°, and 1.7° of them are never entered.
    page.locator(".joint .target").nth(1).fill("165")
    expect(page.locator(".drive-foot .hint")).to_contain_text("only from -164.4° to 164.4°")
    expect(page.locator(".joint .scale").nth(1)).to_have_attribute("title", "-164° to 164°")
    page.locator(".joint .target").nth(1).fill("164")
    expect(page.locator("#go")).to_be_enabled()


def test_a_posture_that_the_controller_refuses_is_not_gone_to(page: Page, server: PlayedServer) -> None:
    why = reasons.posture_touches(3.0, "link6", "post 2", 15.0)
    server.answers["/api/postures/check"] = 409, {"ok": False, "reason": text_of(why), **said_as(why)}
    state_with_postures(server)
    begin(page, "Postures")
    page.get_by_role("button", name="Over the wire", exact=True).click()
    expect(page.locator(".drive-foot .hint")).to_contain_text("3 mm would be between link 6 and post 2")
    expect(page.locator("#go")).to_be_disabled()
    assert holds(server) == []


def test_a_saved_posture_is_chosen_and_then_gone_to_while_held(page: Page, server: PlayedServer) -> None:
    state_with_postures(server)
    begin(page, "Postures")
    page.get_by_role("button", name="Survey", exact=True).click()
    expect(page.locator("#go")).to_have_text("Hold to go: Survey")
    expect(page.locator("#go")).to_be_enabled()
    assert holds(server) == []
    page.locator("#go").hover()
    page.mouse.down()
    until(page, lambda: held(server))
    hold = newest(server)
    assert hold is not None and hold.posture == (0.1, -0.2, 0.3, -2.0, 0.5, 1.2, 0.7)
    page.mouse.up()
    until(page, lambda: not held(server))


def test_the_present_posture_is_saved_and_others_deleted_but_not_the_programs_own(
    page: Page, server: PlayedServer
) -> None:
    state_with_postures(server)
    begin(page, "Postures")
    expect(page.locator(".postures .delete")).to_have_count(1)
    page.get_by_role("button", name="Delete Over the wire").click()
    until(page, lambda: ("/api/postures/delete", {"posture": "Over the wire"}) in server.posted)
    page.locator("#posture-name").fill("  Low  ")
    page.locator("#save-posture").click()
    until(page, lambda: ("/api/postures/save", {"posture": "Low"}) in server.posted)
    expect(page.locator("#posture-name")).to_have_value("")
    why = reasons.posture_name_taken("Low")
    server.answers["/api/postures/save"] = 409, {"ok": False, "reason": text_of(why), **said_as(why)}
    page.locator("#posture-name").fill("Low")
    page.locator("#save-posture").click()
    expect(page.locator("rp-toasts")).to_contain_text("There is a posture “Low” already")
    expect(page.locator("#posture-name")).to_have_value("Low")


# --- the view --------------------------------------------------------------------------------------------------------


def test_whoever_begins_to_move_the_robot_sees_it_though_the_camera_was_at_a_point(
    page: Page, server: PlayedServer
) -> None:
    def placed() -> list[str]:
        return [message.preset for message in server.said if isinstance(message, p.PlaceCamera)]

    page.locator("#teleop").click()
    page.locator("#teleop").click()
    assert placed() == [], "the camera is where it was placed"
    open_screen(page, "work")
    page.locator(".cuts button").first.click()
    open_screen(page, "drive")
    page.locator("#teleop").click()
    until(page, lambda: placed() == ["follow"])
