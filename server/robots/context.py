"""One robot of the server: its hold, its pages, its commands, and its 3-D view, tied together."""

from collections.abc import Callable

from rolling_panda.cut_pictures import PictureFolder
from server.auth.sessions import Session
from server.config import ServerConfig
from server.robots.cut_pictures import CutPictures
from server.robots.event_log import RobotLog
from server.robots.link import RobotCommands, RobotLink
from server.robots.page_view import PageView
from server.robots.pages import RobotPages
from server.robots.scene_updater import SceneUpdater
from server.robots.teleop import Teleoperation
from server.scene.scene import Scene


class RobotContext:
    """The parts of one robot; they belong to the server's event loop.

    Attributes:
        config: Rates and limits.
        link: To the robot's processes.
        scene: Its 3-D view.
        view: Builds the messages of its pages.
        log: Its log.
        teleop: Who holds it, and where it is led.
        pages: Its open pages.
        commands: To its processes.
        scene_updater: Draws the newest messages.
        pictures: Of its cuts.
    """

    def __init__(
        self,
        config: ServerConfig,
        link: RobotLink,
        scene: Scene,
        view: PageView,
        held_elsewhere: Callable[[Session], str] = lambda session: "",
        picture_folder: PictureFolder | None = None,
    ) -> None:
        """Tie the parts together.

        Args:
            config: Rates and limits.
            link: To the robot's processes.
            scene: Its 3-D view.
            view: Builds the messages of its pages.
            held_elsewhere: Name of another robot that a session holds; empty for none.
            picture_folder: Keeps the pictures of cuts; None keeps none.
        """
        self.config, self.link, self.scene, self.view = config, link, scene, view
        self.log = RobotLog(config.log_lines, link.send_event)
        self.teleop = Teleoperation(
            config,
            link,
            scene,
            view,
            self.log,
            held_elsewhere,
            lambda owner, reason: self.pages.end_hold(owner, reason),
        )
        self.pictures = CutPictures(picture_folder, view.model, self.log.note)
        link.on_close_up = self.pictures.add
        self.scene_updater = SceneUpdater(link, view, scene)
        self.pages = RobotPages(link, scene, self.scene_updater, self.teleop)
        self.commands = RobotCommands(link, self.log, self.pages.view_age_s, self.teleop.stopped, config.stop_confirm_s)

    def end_session(self, session: Session) -> None:
        """A session ends: remove everything of it."""
        self.teleop.forget(session)
        self.pages.forget(session)
        self.scene.forget(session.session_id)
