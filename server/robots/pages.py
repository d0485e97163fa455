"""The open pages of one robot: what they are shown and have rendered, who is present, and their clicks."""

import time
from collections import deque
from typing import Protocol

from rolling_panda import messages as m
from rolling_panda.messages.page import Measured, PagePoints, PageState, PickRay
from server.auth.sessions import Session
from server.robots.link import RobotLink
from server.robots.presence import PresenceTracker
from server.robots.scene_updater import SceneUpdater
from server.robots.teleop import Teleoperation
from server.scene.scene import Scene


class Page(Protocol):
    """An open page."""

    session: Session
    view: str
    placing: bool
    measuring: bool

    def wake(self) -> None:
        """Send what is new."""

    def send_measured(self, measured: Measured) -> None:
        """This page's session has picked the second of two points to measure."""

    def send_pick_ray(self, ray: PickRay) -> None:
        """This page's session has clicked into the 3-D view, to place a point there."""

    def send_selected(self, point_id: str) -> None:
        """A point was clicked in the 3-D view of this page's session."""

    def send_hold_ended(self, reason: m.Reason) -> None:
        """The hold of this page's session has ended."""


class RobotPages:
    """The pages of one robot.

    Attributes:
        open: Open pages.
        state: The newest state; None before the first.
        points: The newest points; None before the first.
    """

    def __init__(self, link: RobotLink, scene: Scene, scene_updater: SceneUpdater, teleop: Teleoperation) -> None:
        """No page is open."""
        self._link, self._scene, self._scene_updater, self._teleop = link, scene, scene_updater, teleop
        self.open: set[Page] = set()
        self.state: PageState | None = None
        self.points: PagePoints | None = None
        self._presence = PresenceTracker()
        #: Numbers of the last states, with the time when the posture of each was measured (s).
        self._measured_at: deque[tuple[int, float]] = deque(maxlen=100)

    def show_state(self, state: PageState, now: float) -> None:
        """Show the pages a new state, and remember when its posture was measured."""
        self.state = state
        posture = self._link.posture(now)
        self._measured_at.append((state.number, float("-inf") if posture is None else now - posture.age_s))
        self.wake()

    def show_points(self, points: PagePoints) -> None:
        """Show the pages these points."""
        if points is not self.points:
            self.points = points
            self.wake()

    def wake(self) -> None:
        """Wake the pages, those of operators before those of viewers."""
        for page in sorted(self.open, key=lambda page: not page.session.may_operate):
            page.wake()

    def on_rendered(self, session: Session, view: str, number: int, now: float) -> None:
        """The page `view` of this session has rendered state `number`."""
        self.on_activity(session, now)
        for known, measured_at in reversed(self._measured_at):
            if known == number:
                self._on_seen(session, view, measured_at, now)
                return

    def on_state_fetched(self, session: Session, now: float) -> None:
        """A script has fetched the newest state."""
        if self._measured_at:
            self._on_seen(session, session.session_id, self._measured_at[-1][1], now)

    def on_activity(self, session: Session, now: float) -> None:
        """A page or a script of this session has sent something."""
        if self._presence.on_activity(session, now):
            self.send_presence(now)

    def _on_seen(self, session: Session, view: str, measured_at: float, now: float) -> None:
        self._teleop.view_rendered(view, measured_at, now)
        if self._presence.on_seen(session, measured_at):
            # A request may follow at once, and the controller has to know the age of the view by then.
            self.send_presence(now)

    def send_presence(self, now: float) -> None:
        """Publish the present sessions."""
        self._link.send_presence(self._presence.message(now))

    def view_age_s(self, session: Session) -> float:
        """Age of the newest state that this session has rendered or fetched (s)."""
        return self._presence.view_age_s(session, time.monotonic())

    def end_hold(self, owner: str, reason: m.Reason) -> None:
        """Tell the pages of a session that hold that its hold has ended."""
        for page in self._of(owner):
            page.send_hold_ended(reason)

    def place_by_hand(self, page: Page, placing: bool) -> None:
        """Use the clicks of the page's session to place points, or no more."""
        page.placing = placing and page.session.may_operate
        self._update_click_listener(page.session)

    def measure(self, page: Page, measuring: bool) -> None:
        """Use the clicks of the page's session to measure distances, or no more."""
        page.measuring = measuring and page.session.may_operate
        self._scene.set_measuring(page.session.session_id, page.measuring)
        self._update_click_listener(page.session)

    def _update_click_listener(self, session: Session) -> None:
        listening = any(page.placing or page.measuring for page in self._of(session.session_id))
        self._scene.listen_to_clicks(session.session_id, listening)

    def on_point_clicked(self, owner: str, point_id: str) -> None:
        """`owner` clicked a point in the 3-D view."""
        self._scene.select(owner, point_id)
        pages = self._of(owner)
        # While measuring or placing a point, the next click needs the same view.
        if not any(page.placing or page.measuring for page in pages):
            self._scene.fly_to(owner, point_id)
        for page in pages:
            page.send_selected(point_id)

    def on_click(self, owner: str, origin: m.Vector3, direction: m.Vector3) -> None:
        """`owner` clicked into the 3-D view: the ray goes to the page that places a point, or else measures."""
        pages = self._of(owner)
        for page in pages:
            if page.placing:
                page.send_pick_ray(PickRay(origin=origin, direction=direction))
                return
        measured = self._scene_updater.measure(owner, origin, direction)
        for page in pages:
            if measured is not None and page.measuring:
                page.send_measured(measured)

    def close(self, page: Page, holding: bool) -> None:
        """A page has closed: end its hold, and with the last page of a session remove its gizmo and its preview."""
        self.open.discard(page)
        session = page.session
        self._teleop.forget_view(page.view)
        if holding:
            self._teleop.release(session)
        if page.measuring:
            self.measure(page, False)
        if page.placing:
            self._update_click_listener(session)
        if not self._of(session.session_id):
            self._teleop.hide_gizmo(session)
            self._presence.forget(session)
            self._scene.show_ghost(session.session_id, None)

    def forget(self, session: Session) -> None:
        """The session has ended."""
        self._presence.forget(session)

    def _of(self, owner: str) -> list[Page]:
        return [page for page in self.open if page.session.session_id == owner]
