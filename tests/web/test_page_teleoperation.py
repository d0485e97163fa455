"""Base and joints by hand on the page: keys, the pad, a gamepad, and what ends each hold."""

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.reasons import text_of
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


def begin(page: Page, part: str) -> None:
    page.locator("#teleop").click()
    page.get_by_role("button", name=part, exact=True).click()


def middle(page: Page, selector: str) -> tuple[float, float]:
    box = box_of(page.locator(selector))
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_what_moves_and_along_which_axes_is_chosen(page: Page, server: PlayedServer) -> None:
    expect(page.get_by_role("group", name="What moves")).to_be_hidden()
    page.locator("#teleop").click()
    page.get_by_role("button", name="world", exact=True).click()
    until(page, lambda: p.ShowGizmo(visible=True, axes="world") in server.said)
    page.get_by_role("button", name="Base", exact=True).click()
    until(page, lambda: p.ShowGizmo(visible=False, axes="world") in server.said)
    expect(page.locator("#hold")).to_be_hidden()
    page.get_by_role("group", name="What moves").get_by_role("button", name="Tool", exact=True).click()
    expect(page.get_by_role("button", name="world", exact=True)).to_have_attribute("aria-pressed", "true")
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
    page.mouse.move(x, y - 31)
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
    hint = page.locator("rp-teleoperation > .hint")
    server.controller = controller("TELEOP", proximity=m.Proximity(0.048, "blades – wire 3"))
    expect(hint).to_have_text("48 mm between blades – wire 3.")
    server.controller = msgspec.structs.replace(server.controller, limited_by="joint 4")
    expect(hint).to_have_text("Held back by joint 4.")
    expect(hint).to_have_class("hint warned")
    page.keyboard.up("h")
    expect(hint).to_contain_text("Drag the gizmo")


def test_in_a_mode_without_teleoperation_every_button_says_why(page: Page, server: PlayedServer) -> None:
    why = reasons.cause_recent(1.0)
    server.controller = controller("PAUSED", allowed={"Teleoperation": why})
    expect(page.locator("#teleop")).to_have_attribute("title", text_of(why))
    expect(page.locator("rp-joints")).to_be_hidden()
