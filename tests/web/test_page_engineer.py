"""The screen for engineers: panels that are arranged, versions, the wire, charts."""

import math
from collections.abc import Callable

import msgspec
import pytest
from playwright.sync_api import Locator, Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CameraMount, CameraState, RobotCalibration
from rolling_panda.messages.robot import ArmCalibration, BaseCalibration, FrameTiming
from tests.support.page_parts import open_screen, show_mode
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, bridge, controller, diagnostics

pytestmark = pytest.mark.browser
USUAL = ["alarms", "processes", "telemetry", "charts", "log", "topics", "models", "camera"]


def order(page: Page) -> list[str]:
    return page.locator("rp-engineer > section:visible").evaluate_all("all => all.map(each => each.dataset.panel)")


def tool(page: Page, panel: str, what: str):
    return page.locator(f'[data-panel="{panel}"] [data-arrange="{what}"]')


@pytest.mark.long
def test_panels_are_moved_hidden_shown_and_remembered_by_keys_alone(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    assert order(page) == USUAL
    expect(tool(page, "alarms", "earlier")).to_be_hidden()
    tool(page, "processes", "earlier").press("Enter")
    assert order(page)[:2] == ["processes", "alarms"]
    # It is the first now: the other way is where the focus goes on.
    expect(tool(page, "processes", "later")).to_be_focused()
    tool(page, "log", "hide").press("Enter")
    assert "log" not in order(page)
    show = page.get_by_role("button", name="Show Log")
    expect(show).to_be_focused()
    # What is hidden is passed over.
    tool(page, "topics", "earlier").click()
    assert order(page) == ["processes", "alarms", "telemetry", "topics", "charts", "models", "camera"]
    page.reload()
    expect(page.locator("rp-engineer > section").first).to_be_visible()
    assert order(page) == ["processes", "alarms", "telemetry", "topics", "charts", "models", "camera"]
    page.get_by_role("button", name="Show Log").press("Enter")
    assert "log" in order(page)
    expect(tool(page, "log", "hide")).to_be_focused()
    page.locator("#reset-panels").click()
    assert order(page) == USUAL
    page.reload()
    expect(page.locator("rp-engineer > section").first).to_be_visible()
    assert order(page) == USUAL


def drag(page: Page, panel: str, to: str) -> None:
    """Drag a panel by its title onto another one."""
    title = box_of(page.locator(f'[data-panel="{panel}"] h2'))
    goal = box_of(page.locator(f'[data-panel="{to}"] h2'))
    page.mouse.move(title["x"] + 10, title["y"] + 10)
    page.mouse.down()
    page.mouse.move(title["x"] + 30, title["y"] + 20, steps=3)
    page.mouse.move(goal["x"] + 20, goal["y"] + 10, steps=4)
    page.mouse.up()


def test_a_panel_is_dragged_by_its_title_to_the_place_of_another(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    drag(page, "alarms", "telemetry")
    assert order(page) == ["processes", "telemetry", "alarms", *USUAL[3:]]
    drag(page, "alarms", "processes")
    assert order(page) == USUAL
    drag(page, "alarms", "alarms")
    assert order(page) == USUAL
    drag(page, "processes", "alarms")
    page.reload()
    expect(page.locator("rp-engineer > section").first).to_be_visible()
    assert order(page)[:2] == ["processes", "alarms"]


@pytest.mark.parametrize(
    "kept", ["no JSON", "null", "[]", '{"order": "log"}', '{"order": ["gone", "log", "log"], "hidden": 3}']
)
def test_a_memory_that_is_damaged_or_of_another_version_hides_nothing(
    page: Page, server: PlayedServer, kept: str
) -> None:
    page.evaluate("kept => localStorage.setItem('rp-panels', kept)", kept)
    page.goto(page.url.split("#")[0] + "?again#engineer")
    expect(page.locator("rp-engineer > section").first).to_be_visible()
    assert sorted(order(page)) == sorted(USUAL)


def test_a_panel_that_was_moved_goes_on(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    page.locator("#log-words").fill("signed")
    tool(page, "log", "earlier").click()
    tool(page, "telemetry", "later").click()
    expect(page.locator("#log li:visible .text")).to_have_text(["signed in"])
    expect(page.locator("#log-words")).to_have_value("signed")
    expect(page.locator("#log li")).to_have_count(1)
    expect(page.locator("rp-gauge [class*=value]").first).to_have_text("2.1")


def test_the_way_of_the_base_is_counted_from_a_press_on_whatever_screen_is_open(
    page: Page, server: PlayedServer
) -> None:
    def way(name: str) -> Locator:
        return page.locator(f'[data-way="{name}"] dd')

    def go(x: float, y: float, phi: float) -> None:
        server.pose = m.PlanarPose(x=x, y=y, phi=math.remainder(phi, 2 * math.pi))
        server.tell(server.state())

    open_screen(page, "engineer")
    go(-0.0001, 2.0, -0.0001)
    expect(way("x")).to_have_text("0.000 m")
    expect(way("heading")).to_have_text("0.0°")
    go(1.0, 2.0, 0.0)
    expect(way("x")).to_have_text("1.000 m")
    expect(way("y")).to_have_text("2.000 m")
    page.locator("#way-from-here").click()
    expect(way("distance")).to_have_text("0.000 m")
    open_screen(page, "drive")
    go(1.5, 2.0, 0.0)
    for step in range(1, 11):
        go(1.5, 2.0, step * 0.225 * 2 * math.pi)
    # Two turns and a quarter to the left: back is to the right of the row.
    go(1.5, 1.8, math.pi / 2)
    open_screen(page, "engineer")
    expect(way("heading")).to_have_text("90.0°")
    expect(way("distance")).to_have_text("0.300 m")
    expect(way("turns")).to_have_text("2.250")
    # A bridge that begins again begins its odometry again: that is no motion.
    server.number, server.pose = 0, m.PlanarPose(x=0.0)
    expect(way("x")).to_have_text("0.000 m")
    expect(way("distance")).to_have_text("0.300 m")


@pytest.mark.long
def test_the_cameras_calibration_is_told_checked_and_taken_from_its_panel(page: Page, server: PlayedServer) -> None:
    panel = page.locator("rp-calibration")
    use, row = panel.locator("#use-camera"), lambda name: panel.locator(f'[data-calibration="{name}"]')
    show_mode(page, server, controller("READY"))
    open_screen(page, "engineer")
    expect(row("used")).to_have_text("none: the camera is taken to be where it is drawn")
    expect(row("seen")).to_contain_text("check the camera")
    expect(row("offer")).to_have_text("none")
    expect(use).to_have_attribute("aria-disabled", "true")
    panel.locator("#check-camera").click()
    until(page, lambda: [path for path, _ in server.posted] == ["/api/camera/check"])
    offer = CameraMount(position=(0.0, 0.0, 0.0), quat_xyzw=(0.0, 0.0, 0.0, 1.0), made_at=5.0, source="work", views=9)
    turned = (math.radians(-0.25), math.radians(0.5), 0.0)
    server.camera = CameraState(
        header=m.Header(), offer=offer, turned=turned, turned_sd=(0.001, 0.001, 0.001), observations=12
    )
    expect(row("seen")).to_have_text("0.50° to the right, -0.25° up (±\u00a00.06°), from 12 pictures")
    expect(row("offer")).to_contain_text("from 9 pictures of canes")
    use.click()
    until(page, lambda: server.posted[-1] == ("/api/camera/use", {"made_at": 5.0}))
    show_mode(page, server, controller("AUTO"))
    expect(use).to_have_attribute("aria-disabled", "true")


@pytest.mark.long
def test_the_camera_clocks_calibration_is_told_and_taken_from_the_panel(page: Page, server: PlayedServer) -> None:
    panel = page.locator("rp-calibration")
    use, rows = panel.locator("#use-timing"), panel.locator("[data-calibration^=timing]")
    show_mode(page, server, controller("IDLE"))
    open_screen(page, "engineer")
    expect(rows).to_have_text(["none: pictures are taken to be as late as configured", "none"])
    expect(use).to_have_attribute("aria-disabled", "true")
    expect(panel.locator("#calibrate-timing")).to_have_count(0)
    made = FrameTiming(delay=0.0384, made_at=5.0, views=14, delay_sd=0.0021)
    server.calibration = RobotCalibration(header=m.Header(), timing=made)
    measured = "from 14 pictures in motion: 38 ms late (±\u00a02 ms)"
    expect(rows.last).to_contain_text(measured, timeout=6000)
    use.click()
    until(page, lambda: server.posted[-1] == ("/api/timing/use", {"made_at": 5.0}))
    server.bridge = bridge(timing=made)
    expect(rows.first).to_contain_text(measured)
    expect(rows.last).to_have_text("none")
    expect(use).to_have_attribute("aria-disabled", "true")


def calibrated(page: Page, server: PlayedServer, part: str, none: str) -> tuple[Locator, Callable[[str], Locator]]:
    """Press Calibrate for a part that is as drawn; its button Use, and the rows by name."""
    panel = page.locator("rp-calibration")
    use = panel.locator(f"#use-{part}")

    def row(name: str) -> Locator:
        return panel.locator(f'[data-calibration="{name}"]')

    show_mode(page, server, controller("READY"))
    open_screen(page, "engineer")
    expect(row(part)).to_have_text(none)
    expect(row(f"{part}_offer")).to_have_text("none")
    expect(use).to_have_attribute("aria-disabled", "true")
    panel.locator(f"#calibrate-{part}").click()
    until(page, lambda: [path for path, _ in server.posted] == [f"/api/{part}/calibrate"])
    return use, row


@pytest.mark.long
def test_the_bases_calibration_is_told_measured_and_taken_from_the_panel(page: Page, server: PlayedServer) -> None:
    use, row = calibrated(page, server, "base", "none: the wheels are taken to be as drawn")
    server.calibration = RobotCalibration(header=m.Header(), base_views=33, base_refused=reasons.base_slipped(2.5, 1.0))
    expect(row("base_offer")).to_contain_text("The wheels slipped", timeout=6000)
    expect(use).to_have_attribute("aria-disabled", "true")
    made = BaseCalibration(
        left=0.1325, right=0.1326, track=0.511, made_at=5.0, views=33, radius_sd=0.001, track_sd=0.002
    )
    server.calibration = RobotCalibration(header=m.Header(), base_views=33, base=made)
    measured = "from 33 pictures: wheels 132.50 and 132.60 mm, track 511.00 mm (±\u00a00.10 %, ±\u00a00.20 %)"
    expect(row("base_offer")).to_contain_text(measured, timeout=6000)
    use.click()
    until(page, lambda: server.posted[-1] == ("/api/base/use", {"made_at": 5.0}))
    server.bridge = bridge(base=made)
    expect(row("base")).to_contain_text(measured)
    expect(row("base_offer")).to_have_text("none")
    expect(use).to_have_attribute("aria-disabled", "true")


@pytest.mark.long
def test_the_arms_calibration_is_told_measured_and_taken_from_the_panel(page: Page, server: PlayedServer) -> None:
    use, row = calibrated(page, server, "arm", "none: the joints' zeros are taken to be as drawn")
    server.calibration = RobotCalibration(header=m.Header(), arm_views=25, arm_refused=reasons.arm_unsure(0.21, 0.05))
    expect(row("arm_offer")).to_contain_text("uncertain by 0.21°", timeout=6000)
    expect(row("base_offer")).to_have_text("none")
    expect(use).to_have_attribute("aria-disabled", "true")
    offsets = (0.0, *(math.radians(each) for each in (0.5, -0.25, 0.1, 0.0, 1.0)), 0.0)
    made = ArmCalibration(offsets=offsets, made_at=5.0, views=25, pixels=0.12, offset_sd=math.radians(0.01))
    server.calibration = RobotCalibration(header=m.Header(), arm_views=25, arm=made)
    measured = "from 25 pictures: joints 2 to 6 off by 0.50, -0.25, 0.10, 0.00, 1.00° (±\u00a00.01°), error 0.12 px"
    expect(row("arm_offer")).to_contain_text(measured, timeout=6000)
    use.click()
    until(page, lambda: server.posted[-1] == ("/api/arm/use", {"made_at": 5.0}))
    server.bridge = bridge(arm=made)
    expect(row("arm")).to_contain_text(measured)
    expect(row("arm_offer")).to_have_text("none")
    expect(use).to_have_attribute("aria-disabled", "true")
    expect(row("base")).to_have_text("none: the wheels are taken to be as drawn")


def test_the_arms_commands_in_time_are_told_of_a_real_robot_alone(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    gauge = page.locator('[data-gauge="arm-success"]')
    expect(gauge).to_be_hidden()
    server.bridge = bridge(kind="real", arm_success=0.93)
    expect(gauge.locator(".value")).to_have_text("93")
    expect(gauge.locator(".gauge-warning")).to_have_text("▾ low")


@pytest.mark.long
def test_processes_have_versions_and_a_different_one_is_told(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    row = page.locator('[data-panel="processes"] [data-process="bridge"]')
    expect(row).to_contain_text("0.1.0")
    expect(row).to_contain_text("1 h 23 min")
    expect(page.locator('[data-panel="processes"] .warned')).to_be_empty()
    told = diagnostics()
    programs = (msgspec.structs.replace(told.programs[0], version="0.2.0"), *told.programs[2:])
    server.diagnostics = msgspec.structs.replace(told, programs=programs)
    expect(page.locator('[data-panel="processes"] .warned')).to_contain_text("different versions", timeout=6000)
    expect(page.locator('[data-panel="processes"] [data-process="controller"]')).to_contain_text("not told")
    server.gone = {"bridge": 5.0}
    expect(row).to_have_attribute("data-present", "false")


@pytest.mark.long
def test_every_topic_has_its_rate_and_age_and_a_late_one_stands_out(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    rows = page.locator('[data-panel="topics"] tbody tr')
    expect(rows).to_have_count(len(server.diagnostics.topics))
    expect(page.locator('[data-topic="state/joints"]')).to_contain_text("100 Hz")
    expect(page.locator('[data-topic="command/motion"]')).to_contain_text("not for the server")
    expect(page.locator('[data-late="true"]')).to_have_count(0)
    topics = [
        msgspec.structs.replace(each, age_s=9.0, rejected=3) if each.name in ("state/joints", "event") else each
        for each in diagnostics().topics
    ]
    server.diagnostics = msgspec.structs.replace(server.diagnostics, topics=tuple(topics))
    # A log line comes on event, and is never late.
    expect(page.locator('[data-late="true"]')).to_have_attribute("data-topic", "state/joints", timeout=6000)
    expect(page.locator('[data-topic="event"] td').last).to_have_text("3")


def test_the_hashes_of_plan_and_points_are_there(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    panel = page.locator('[data-panel="models"]')
    expect(panel.locator('[data-model="network"] dd')).to_have_text("simulator labels")
    expect(panel.locator('[data-model="method"] dd')).to_have_text("nullspace")
    expect(panel.locator('[data-model="plan"] dd')).to_have_text("–")
    panel.locator("summary").click()
    expect(panel.locator("tbody tr").first).to_contain_text(server.points[0].point.digest)


def test_charts_have_axes_and_show_the_values_of_a_moment(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    chart = page.locator('[data-chart="position-error"] canvas')
    expect(chart).to_be_visible()
    page.wait_for_timeout(700)
    # Words of the axes are drawn at the left and below, where no curve is.
    ink = chart.evaluate("""canvas => {
      const scale = canvas.width / canvas.clientWidth, pen = canvas.getContext("2d");
      const drawn = (x, y, w, h) => {
        const pixels = pen.getImageData(x * scale, y * scale, w * scale, h * scale).data;
        return pixels.some((value, index) => index % 4 === 3 && value > 90);
      };
      return {
        values: drawn(0, 0, 56, 16), zero: drawn(40, canvas.clientHeight - 30, 20, 20),
        times: drawn(66, canvas.clientHeight - 14, canvas.clientWidth - 80, 14),
      };
    }""")
    assert ink == {"values": True, "zero": True, "times": True}
    page.locator("rp-charts").focus()
    page.keyboard.press("ArrowLeft")
    expect(page.locator('[data-panel="charts"] .panel-head')).to_contain_text("ago")


def test_alarms_are_listed_with_what_to_do(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    panel = page.locator('[data-panel="alarms"]')
    expect(panel).to_contain_text("No alarms.")
    server.plain_wire = True
    expect(panel.locator('[data-code="wire_plain"]')).to_be_visible()
    server.plain_wire = False
    expect(panel.locator("li")).to_have_count(0)
