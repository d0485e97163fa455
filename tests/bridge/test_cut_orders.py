from bridge.core.cut_orders import BUSY, CutOrders
from rolling_panda.messages.robot import CutCommand


def order(cut_id: str) -> CutCommand:
    return CutCommand(epoch=3, cut_id=cut_id, point_id="p1")


def test_a_cut_is_acted_on_once() -> None:
    orders = CutOrders()
    assert orders.judge(order("a"), None, True, "") == ("cut", "")
    assert all(orders.judge(order("a"), None, True, "")[0] == "known" for _ in range(100))


def test_an_order_while_inhibited_is_spent() -> None:
    orders = CutOrders()
    assert orders.judge(order("a"), None, True, "stopped") == ("refuse", "stopped")
    assert orders.judge(order("a"), None, True, "")[0] == "known"


def test_a_wrong_token_motion_or_busy_blades_do_not_spend_the_order() -> None:
    orders = CutOrders()
    assert orders.judge(order("a"), "an older token", True, "") == ("refuse", "an older token")
    assert orders.judge(order("a"), None, False, "") == ("refuse", BUSY)
    assert orders.judge(order("a"), None, True, "") == ("cut", "")
