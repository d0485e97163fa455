"""What states of the operator's page are made of: robots, queues, who holds control, and the way back from a state."""

from typing import Any, get_args

import msgspec
from playwright.sync_api import Locator, Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.messages.supervision import ControlState, PointPlan, PreviewState
from rolling_panda.messages.types import CutKind
from rolling_panda.reasons import said
from tests.support.played_server import PlayedServer, controller, point
from tests.support.points import rolled_out

PLANNING = (
    "RequestPreview", "ApprovePreview", "RequirePreview", "SetApproach", "MoveInQueue", "ResetOrder", "Survey",
    "LookAgain",
)  # fmt: skip


def ready(**changes: Any) -> m.ControllerState:
    """A robot that is armed and takes everything that goes with accepted points."""
    state = controller("READY", **changes)
    return msgspec.structs.replace(state, allowed=state.allowed | dict.fromkeys(PLANNING))


def planned(row: p.PagePoint, order: int, reason: str = "") -> p.PagePoint:
    plan = PointPlan(
        point_id=row.point.point_id,
        revision=4,
        order=order,
        reason=reason,
        rollout=rolled_out(row.point.point_id, 4, ends_s=3.1 + 0.4 * order),
    )
    return msgspec.structs.replace(row, plan=plan)


def accepted(number: int, spur: int) -> p.PagePoint:
    return planned(point(number, "ACCEPTED", spur=spur, user="Ada"), number)


def queue() -> tuple[p.PagePoint, ...]:
    """Two vines in the middle of the work."""
    return (
        accepted(1, 1),
        accepted(2, 2),
        point(3, "PROPOSED", spur=3),
        point(4, "PROPOSED", vine=2),
        point(5, "REJECTED", vine=2, spur=2, user="Ada", reason="rejected by Ada: too near a wire"),
        point(6, "DONE", vine=2, spur=3, cut_id="c6", user="Ada", reason="cut"),
    )


def of_kind(row: p.PagePoint, kind: CutKind, reason: m.Reason, **changes: Any) -> p.PagePoint:
    """The same point with a cut of another kind, which has another hash."""
    digest = f"{get_args(CutKind).index(kind)}" + row.point.digest[1:]
    changed = msgspec.structs.replace(row.point, kind=kind, reason=reason, digest=digest, **changes)
    return msgspec.structs.replace(row, point=changed)


def removal(row: p.PagePoint) -> p.PagePoint:
    """The same point as a removal of last year's cane: nothing on it is counted."""
    nothing: dict[str, Any] = {"nodes_kept": 0, "nodes_seen": 0, "offset": None, "node_distance": None}
    return of_kind(row, "removal", said("Between the head and the first cane on it"), radius=0.007, **nothing)


def guyot_vine() -> tuple[p.PagePoint, ...]:
    """The three cuts of a Guyot vine: the next spur, the next fruiting cane, and last year's cane off."""
    return (
        of_kind(point(1, "ACCEPTED", user="Ada"), "spur cut", reasons.guyot_cut_lower(20.0, 2)),
        of_kind(point(2, "PROPOSED"), "cane cut", reasons.guyot_cut_upper(20.0, 8), nodes_kept=8),
        removal(point(3, "PROPOSED")),
    )


def show(server: PlayedServer, *points: p.PagePoint) -> None:
    server.points = points
    server.tell(server.page_points())


def show_mode(page: Page, server: PlayedServer, state: m.ControllerState) -> None:
    server.controller = state
    expect(page.locator("#mode")).to_have_attribute("data-mode", state.mode)


def working(page: Page, server: PlayedServer) -> None:
    """Where most states begin: armed, with a queue."""
    show_mode(page, server, ready())
    show(server, *queue())
    expect(page.locator("#start")).to_be_visible()


def open_screen(page: Page, name: str) -> None:
    """By its tab; a screen is fetched when it is first opened."""
    page.locator(f'[data-tab="{name}"]').click()
    expect(page.locator("main")).to_have_attribute("data-screen", name)
    expect(page.locator(f"rp-{name}:defined")).to_be_visible()


def choose(page: Page, name: str) -> Locator:
    """Look at a point or a place."""
    open_screen(page, "review")
    mark(page, name).click()
    return looking_at(page, name)


def mark(page: Page, key: str) -> Locator:
    """The sign of a point or a place in the strip of all."""
    return page.locator(f'.strip-mark[data-key="{key}"]')


def looking_at(page: Page, key: str) -> Locator:
    """The review, once this point or place is pictured, and may be decided about."""
    review = page.locator(f'rp-review[data-key="{key}"][data-pictured="shown"]')
    expect(review).to_be_visible()
    # A press right after another picture has come was meant for the one before.
    page.wait_for_timeout(260)
    return review


def leave(page: Page, server: PlayedServer) -> None:
    """Back to where a page begins, as far as another state would be taken for this one; a stop stays pressed."""
    lost = not server.online
    new = PlayedServer()
    for name in ("bridge", "undecided_sites", "gone", "role", "control", "stopped", "replay", "rule", "online"):
        setattr(server, name, getattr(new, name))
    if lost:
        expect(page.locator("rp-link-banner")).to_be_hidden(timeout=10_000)
    server.tell(p.PagePreview(preview=PreviewState(header=m.Header(), required=False, phase="none")))
    if page.locator("#close-preview").is_visible():
        page.locator("#close-preview").click()
    page.locator("dialog[open]").evaluate_all("all => all.forEach(each => each.close())")
    open_screen(page, "work")
    page.locator("details[open]").evaluate_all("all => all.forEach(each => { each.open = false; })")


FREE = ControlState(
    holder="", user="", expires_s=0.0, requested_by="", requested_key="", next_user="", notice=None, notice_number=0,
    supervised=True,
)  # fmt: skip


def held(holder: str, user: str, **changes: object) -> ControlState:
    return msgspec.structs.replace(FREE, holder=holder, user=user, expires_s=0.8, **changes)
