"""Bridge, controller and server over a real router, all in this process, on a robot that only integrates."""

import threading
from contextlib import ExitStack, contextmanager

import numpy as np

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.odometer import Odometer
from bridge.loop import bridge_runner
from controller.config import ControllerConfig
from controller.core import Controller
from controller.ledger.start import restored
from controller.ledger.store import Ledger
from controller.ledger.writer import LedgerWriter
from controller.loop import controller_runner, open_stop_file
from rolling_panda.config import RobotConfig, TransportConfig
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.zenoh import Transport
from tests.support.processes.local_router import local_router
from tests.support.running_server import running_server
from tests.support.worlds.lagged_robot import LaggedRobot

MODEL = RobotModel()
CONFIG = ControllerConfig()


class LiveTwo:
    """`server` is the running server, `robot` what is actuated; the controller can be started anew."""

    def __init__(self, endpoint, folder):
        self.endpoint, self.folder = endpoint, folder
        self.robot = LaggedRobot(CONFIG.work.home)
        self._running = []

    def transport(self, process):
        return Transport(TransportConfig(connect=(self.endpoint,), plain_wire=True), process, "rp1")

    @contextmanager
    def bridge(self):
        odometer = Odometer(MODEL.drive, OdometryConfig(), TICK_S)
        core = BridgeCore(self.robot, BridgeConfig(), MODEL.limits, odometer, "sim")
        with self.transport("bridge") as transport:
            loop, stopping = bridge_runner(core, transport), threading.Event()
            with running(loop.run, stopping):
                yield

    def start_controller(self):
        """Start it, or end it and start it again with what is on disk."""
        self.stop_controller()
        stop_file = open_stop_file(self.folder)
        controller = Controller(CONFIG, RobotConfig())
        before = restored(self.folder)
        controller.restore(before.tickets, stop_file.stops, before.order, before.preview)
        stack = ExitStack()
        stack.callback(stop_file.close)
        ledger = LedgerWriter(lambda: Ledger(self.folder))
        stack.callback(ledger.close)
        transport = stack.enter_context(self.transport("controller"))
        loop = controller_runner(controller, transport, CONFIG.rate_hz, ledger, stop_file=stop_file)
        stack.enter_context(running(loop.run, threading.Event()))
        self._running.append(stack)

    def stop_controller(self):
        while self._running:
            self._running.pop().close()

    def moved(self, since):
        """How fast a wheel turned at most (rad/s) since this row of the record."""
        rows = self.robot.rows[since:]
        return max((float(np.abs(row[2]).max()) for row in rows), default=0.0)


@contextmanager
def running(run, stopping):
    thread = threading.Thread(target=run, args=(stopping,))
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join()


@contextmanager
def live_two(folder):
    with local_router() as endpoint:
        live = LiveTwo(endpoint, folder)
        with live.bridge(), live.transport("server") as wire, running_server(wire) as server:
            live.server = server
            live.start_controller()
            try:
                yield live
            finally:
                live.stop_controller()
