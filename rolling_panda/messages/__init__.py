"""Messages of the wire: frozen, typed, SI units, strict. Those of the page are in `rolling_panda.messages.page`."""

from rolling_panda.messages.perception import *  # noqa: F403
from rolling_panda.messages.robot import *  # noqa: F403
from rolling_panda.messages.supervision import *  # noqa: F403
from rolling_panda.messages.types import *  # noqa: F403
