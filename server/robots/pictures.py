"""Pictures of spurs, for the people who decide about cuts."""

from typing import TypeVar

from rolling_panda.messages.perception import SpurPicture

Key = TypeVar("Key")

#: Points and spurs whose pictures are kept; a picture has 60 kB at most, mostly 15.
_MAX_PICTURES = 2000


class PictureStore:
    """The newest picture of each spur, and of each point the newest that shows it: after a cut, the last one before.

    It may be filled on another thread than it is read on.
    """

    def __init__(self) -> None:
        """Start empty."""
        self._points: dict[str, SpurPicture] = {}
        self._spurs: dict[tuple[int, int], SpurPicture] = {}

    def add(self, picture: SpurPicture) -> None:
        """Store a picture; the oldest is dropped."""
        _put(self._spurs, (picture.drawing.vine, picture.drawing.spur), picture)
        for cut in picture.drawing.cuts:
            _put(self._points, cut.point_id, picture)

    def of_point(self, point_id: str) -> SpurPicture | None:
        """The newest picture that shows a point; None without one."""
        return self._points.get(point_id)

    def of_spur(self, vine: int, spur: int) -> SpurPicture | None:
        """The newest picture of a spur; None without one."""
        return self._spurs.get((vine, spur))


def _put(store: dict[Key, SpurPicture], key: Key, picture: SpurPicture) -> None:
    # The newest goes last, so that the oldest are dropped first.
    store.pop(key, None)
    store[key] = picture
    if len(store) > _MAX_PICTURES:
        del store[next(iter(store))]
