from bridge.cut_orders import BUSY, OLD_EPOCH, CutOrders
from rolling_panda.messages import CutCommand


def order(cut_id: str, epoch: int = 3) -> CutCommand:
    return CutCommand(epoch=epoch, cut_id=cut_id, point_id="p1")


def test_a_cut_is_acted_on_once() -> None:
    orders = CutOrders()
    assert orders.judge(order("a"), 3, True, "") == ("cut", "")
    assert all(orders.judge(order("a"), 3, True, "")[0] == "known" for _ in range(100))


def test_an_order_while_inhibited_is_spent() -> None:
    orders = CutOrders()
    assert orders.judge(order("a"), 3, True, "stopped") == ("refuse", "stopped")
    assert orders.judge(order("a"), 3, True, "")[0] == "known"


def test_an_old_epoch_or_busy_blades_do_not_spend_the_order() -> None:
    orders = CutOrders()
    assert orders.judge(order("a", 2), 3, True, "") == ("refuse", OLD_EPOCH)
    assert orders.judge(order("a"), 3, False, "") == ("refuse", BUSY)
    assert orders.judge(order("a"), 3, True, "") == ("cut", "")
