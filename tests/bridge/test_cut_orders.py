from bridge.core.cut_orders import BUSY, CutOrders
from rolling_panda import reasons
from rolling_panda.messages.robot import CutCommand

STOPPED, OLD_EPOCH = reasons.stop_latched(), reasons.epoch_old()


def order(cut_id: str) -> CutCommand:
    return CutCommand(epoch=3, cut_id=cut_id, point_id="p1")


def test_a_cut_is_acted_on_once() -> None:
    orders = CutOrders()
    assert orders.judge(order("a"), None, True, None) == ("cut", None)
    assert all(orders.judge(order("a"), None, True, None)[0] == "known" for _ in range(100))


def test_an_order_while_inhibited_is_spent() -> None:
    orders = CutOrders()
    assert orders.judge(order("a"), None, True, STOPPED) == ("refuse", STOPPED)
    assert orders.judge(order("a"), None, True, None)[0] == "known"


def test_a_wrong_token_motion_or_busy_blades_do_not_spend_the_order() -> None:
    orders = CutOrders()
    assert orders.judge(order("a"), OLD_EPOCH, True, None) == ("refuse", OLD_EPOCH)
    assert orders.judge(order("a"), None, False, None) == ("refuse", BUSY)
    assert orders.judge(order("a"), None, True, None) == ("cut", None)
