"""Bridge and controller as processes of a simulated world, without sockets or sleeping."""

from collections import deque
from collections.abc import Callable

from bridge.core.bridge import TICK_S, BridgeCore
from bridge.loop import BridgeProcess
from controller.core import Controller
from controller.ledger.journal import LedgerState, Records
from controller.planning.preview_plan import PreviewRequest
from controller.planning.work_plan import PlanRequest, WorkPlan
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.reasons import said
from rolling_panda.transport.inbox import Inbox
from rolling_panda.transport.memory import World

#: A plan of some points takes about this long (s).
_PLANNING_S = 1.0


class RecordedController:
    """A controller whose records are durable at once, and whose plans take a second; no `plan` leaves them away."""

    def __init__(self, controller: Controller, plan: Callable[[PlanRequest], WorkPlan] | None = None) -> None:
        """Bind the core."""
        self.controller, self._plan = controller, plan
        self._planned: deque[tuple[float, WorkPlan]] = deque()

    def step(self, inbox: Inbox, now: float) -> list[object]:
        """One control period."""
        while self._planned and now >= self._planned[0][0]:
            inbox.put(self._planned.popleft()[1], now)
        out: list[object] = []
        for message in self.controller.step(inbox, now):
            match message:
                case Records():
                    inbox.put(LedgerState(message.rows[-1].number), now)
                case PlanRequest():
                    if self._plan is not None:
                        self._planned.append((now + _PLANNING_S, self._plan(message)))
                case PreviewRequest():
                    pass
                case _:
                    out.append(message)
        return out

    def end(self) -> list[object]:
        """The last messages."""
        return self.controller.end()


class RobotWorld(World):
    """A robot with an operator; the same seed and operator give the same messages."""

    def __init__(
        self,
        bridge: BridgeCore,
        controller: Controller,
        rate_hz: float,
        plan: Callable[[PlanRequest], WorkPlan] | None = None,
        seed: int = 0,
    ) -> None:
        """Start both; the controller steps at `rate_hz`."""
        super().__init__(seed, TICK_S)
        self._plan = plan
        self.bridge_node = self.add("bridge", BridgeProcess(bridge, 0.0), TICK_S, at_once={m.StopRequest: "stop"})
        self.controller_node = self.add("controller", RecordedController(controller, plan), 1.0 / rate_hz, 5.0)
        self._bridge, self._controller = bridge, controller

    @property
    def bridge(self) -> BridgeCore:
        """The bridge's core; another one is a restart."""
        return self._bridge

    @bridge.setter
    def bridge(self, core: BridgeCore) -> None:
        self._bridge = core
        self.bridge_node.start(BridgeProcess(core, self.now))

    @property
    def controller(self) -> Controller:
        """The controller's core; another one is a restart."""
        return self._controller

    @controller.setter
    def controller(self, core: Controller) -> None:
        self._controller = core
        self.controller_node.start(RecordedController(core, self._plan))

    @property
    def inbox(self) -> Inbox:
        """What has arrived at the controller."""
        return self.controller_node.runner.inbox

    def stop(self, reason: str = "trial") -> None:
        """Press the software stop."""
        self.say(m.StopRequest(stop_id=f"stop-{self.ticks}", source="server", user="operator", reason=said(reason)))

    def command(self, intent: intents.Intent) -> m.Answer:
        """Ask the controller, and advance until it answers."""
        return self.ask("controller", intent)
