"""What is drawn on the played pictures of spurs: an upright cane in the middle, or the wood that lies below it."""

from rolling_panda.messages.page import PagePoint
from rolling_panda.messages.perception import AxisPixel, DrawnCut, SpurDrawing

#: Of the picture (px), and of a pixel along the cane (m).
SIZE = (240, 180)
METRES = 0.002
#: Row of the cut in the picture; the cane goes up from `BASE`.
COLUMN, CUT, BASE, TIP = 120.0, 80.0, 160.0, 0.0
#: Row of the wood that lies, and columns of the shoots on it beyond its cut: each from its upper side to near the top.
LYING, SHOOTS = 131.0, (140.0, 167.5, 195.0, 222.5)


def drawing(vine: int, spur: int, *rows: PagePoint, image: str = "") -> SpurDrawing:
    """The picture of a spur with the cuts of some points, each 10 px beside the one before."""
    return SpurDrawing(
        vine=vine,
        spur=spur,
        image=image or f"{vine:04x}{spur:04x}",
        sequence=7,
        frame=(848, 480),
        window=(300, 100, *SIZE),
        size=SIZE,
        canes=(((COLUMN, BASE), (COLUMN, TIP)),),
        cuts=tuple(_cut(row, COLUMN + 10.0 * k) for k, row in enumerate(rows)),
    )


def _cut(row: PagePoint, column: float) -> DrawnCut:
    if row.point.kind == "removal":
        lying: tuple[AxisPixel, ...] = tuple((u, LYING, METRES * (u - COLUMN)) for u in (90.0, COLUMN, 180.0, 240.0))
        return DrawnCut(
            point_id=row.point.point_id,
            revision=row.point.revision,
            position=(COLUMN, LYING),
            axis=lying,
            falls=tuple(((u, LYING - 6.0), (u + 9.0, 10.0)) for u in SHOOTS),
            thickness=10.0,
        )
    axis: tuple[AxisPixel, ...] = tuple((column, v, METRES * (CUT - v)) for v in (BASE, 120.0, CUT, 40.0, TIP))
    return DrawnCut(
        point_id=row.point.point_id,
        revision=row.point.revision,
        position=(column, CUT),
        axis=axis,
        nodes=((column, 140.0, METRES * (CUT - 140.0)), (column, 90.0, METRES * (CUT - 90.0)), (column, 30.0, 0.1)),
        thickness=7.0,
    )
