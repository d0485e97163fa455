"""How often pages and 3-D views are told."""

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from rolling_panda.messages.page import PageState, ProcessPresence
from rolling_panda.messages.supervision import StopState
from server.api.page_pace import PagePace
from tests.support.fake_wire import controller_state


def state(number: int, **more: object) -> PageState:
    shown = PageState(
        number=number,
        user="",
        role="viewer",
        viewers=1,
        processes=(ProcessPresence("bridge", True, 0.0),),
        controller=controller_state(),
        controller_age_s=0.0,
        bridge=None,
        bridge_age_s=None,
        joints=None,
        base=None,
        camera_frame=0,
    )
    return msgspec.structs.replace(shown, **more)


@given(st.integers(1, 10), st.integers(0, 1000))
def test_whoever_may_operate_is_told_all_and_an_onlooker_its_share(every: int, first: int) -> None:
    operator, onlooker = PagePace(10.0, 10.0 / every), PagePace(10.0, 10.0 / every)
    states = [state(number) for number in range(first, first + 10 * every)]
    assert all(operator.due(each, True) for each in states)
    told = [each.number for each in states if onlooker.due(each, False)]
    assert told[0] == first, "a page that was just opened waits for nothing"
    assert 10 <= len(told) <= 11
    assert not onlooker.due(states[-1], False) and not operator.due(states[-1], True), "nothing is told twice"


def test_an_onlooker_hears_of_a_stop_a_mode_and_a_lost_process_at_once() -> None:
    pace = PagePace(10.0, 1.0)
    assert pace.due(state(10), False)
    assert not pace.due(state(11), False)
    stopped = {"stops": (StopState(process="bridge", stops=(), hardware=True),)}
    assert pace.due(state(12, **stopped), False)
    assert not pace.due(state(13, **stopped), False)
    other = {**stopped, "controller": msgspec.structs.replace(controller_state(), mode="PAUSED")}
    assert pace.due(state(14, **other), False)
    assert pace.due(state(15, **other, processes=(ProcessPresence("bridge", False, 3.0),)), False)
    assert not pace.due(state(16, **other, processes=(ProcessPresence("bridge", False, 3.1),)), False)
