from controller.identity import Client
from controller.supervision.authority import Authority
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.messages.supervision import NEVER_SEEN_S, Person, Presence
from rolling_panda.transport.inbox import Received

ADA, BOB = Client("a", "Ada"), Client("b", "Bob")


def ask(it, intent, now):
    return it.handlers()[type(intent)](intent, now)


def authority():
    return Authority(2.0)


def presence(number, at, *people):
    return Received(Presence(sequence=number, people=people), at)


def ada(age=0.0, role="operator", heard=0.0):
    return Person("a", "Ada", role, heard, age)


def test_rights_follow_role_and_lease():
    it = authority()
    assert it.rights(ADA, "viewer") == {"anyone"}
    assert it.rights(ADA, "operator") == {"anyone", "operator", "holder"}
    assert it.rights(ADA, "supervisor") == {"anyone", "operator", "holder", "supervisor"}
    it.claim(ADA, 0.0)
    assert it.rights(ADA, "operator") >= {"holder"}
    assert it.rights(BOB, "supervisor") == {"anyone", "operator", "supervisor"}


def test_what_is_told_names_the_holder_and_nobody_where_nobody_holds():
    it = authority()
    nobody = it.message(0.0)
    assert (nobody.holder, nobody.user, nobody.next_user, nobody.expires_s) == ("", "", "", 0.0)
    assert (nobody.requested_by, nobody.requested_key) == ("", "")
    it.claim(ADA, 0.0)
    told = it.message(0.25)
    assert (told.holder, told.user, told.expires_s) == (ADA.key, ADA.user, 0.75)


def test_whether_an_operator_sees_the_robot_is_told():
    it = authority()
    assert it.message(0.0).supervised is False
    it.review(presence(1, 0.0, ada()), True, 0.0)
    assert it.message(0.0).supervised is True


def test_what_an_operator_saw_when_they_asked_counts_and_what_a_viewer_saw_does_not():
    it = authority()
    it.saw(intents.Arm(user="eve", role="viewer", view_age_s=0.0), 3.0)
    assert it.unwatched(3.0)
    it.saw(intents.Arm(user="ada", role="operator", view_age_s=0.5), 3.0)
    assert it.unwatched(4.4) is None and it.unwatched(4.75) == reasons.unwatched(2.25, 2.0)


def test_who_may_move_the_robot_is_refused_by_name_and_a_viewer_always():
    it = authority()
    assert it.refusal(BOB, "operator") is None
    assert it.refusal(BOB, "viewer") == reasons.viewer_only()
    it.claim(ADA, 0.0)
    assert it.refusal(ADA, "operator") is None
    assert it.refusal(BOB, "supervisor") == reasons.control_held("Ada")
    assert it.refusal(ADA, "viewer") == reasons.viewer_only()


def test_the_servers_word_renews_the_lease_and_its_silence_ends_it():
    it = authority()
    it.claim(ADA, 0.0)
    for number in range(1, 20):
        assert it.review(presence(number, number * 0.2, ada()), False, number * 0.2) is None
    assert it.held
    assert it.review(None, False, 19 * 0.2 + 1.0) == reasons.control_lapsed("Ada", 1.0)
    assert not it.held


def test_a_server_that_still_lists_somebody_does_not_renew_control_without_a_word_of_theirs():
    it = authority()
    it.claim(ADA, 0.0)
    lost = None
    for number in range(1, 9):
        now = number * 0.2
        # Ada said something last at 0.2 s, and the server lists her for a second more.
        people = (ada(heard=now - 0.2),) if now <= 1.2 else ()
        lost = lost or it.review(presence(number, now, *people), False, now)
        assert bool(lost) == (now >= 1.2)
    assert lost == reasons.control_lapsed("Ada", 1.0)


def test_a_repeated_or_older_word_renews_nothing():
    it = authority()
    it.claim(ADA, 7.0)
    it.review(presence(5, 7.1, ada()), False, 7.1)
    it.review(presence(5, 7.6, ada()), False, 7.6)
    it.review(presence(4, 7.9, ada()), False, 7.9)
    assert it.review(None, False, 8.1)


def test_a_server_that_has_started_again_counts_from_one():
    it = authority()
    it.review(presence(900, 4.0, ada()), True, 4.0)
    it.claim(ADA, 5.0)
    it.review(presence(1, 5.1, ada()), True, 5.1)
    assert it.review(presence(2, 5.9, ada()), True, 6.05) is None


def test_work_is_watched_by_who_may_operate_and_sees_the_robot():
    it = authority()
    assert it.unwatched(0.0) == reasons.never_watched(2.0)
    it.review(presence(1, 1.0, ada(role="viewer")), True, 1.0)
    assert it.unwatched(1.0)
    it.review(presence(2, 2.0, ada(age=0.3)), True, 2.0)
    assert it.unwatched(3.6) is None
    assert it.unwatched(3.8) == reasons.unwatched(3.8 - (2.0 - 0.3), 2.0)
    # Heard, but nothing that is new has been drawn.
    it.review(presence(3, 3.8, ada(age=2.1)), True, 3.8)
    assert it.unwatched(3.8)


def test_a_viewer_has_no_say_in_control():
    it = authority()
    eve = Client("e", "eve")
    assert "operator" not in it.rights(eve, "viewer") and it.refusal(eve, "viewer") == reasons.viewer_only()


def test_the_old_holder_is_told_before_and_after_control_goes_over():
    it = authority()
    it.claim(ADA, 0.0)
    before = it.message(0.0)
    assert ask(it, intents.TakeControl(user="Bob", client="b", confirm=True), 0.1) is None
    assert it.message(0.1).next_user == "Bob" and it.message(0.1).holder == "a"
    assert it.review(None, False, 0.1) == reasons.control_taken("Bob")
    it.review(None, True, 0.2)
    after = it.message(0.2)
    assert (after.holder, after.user, after.next_user) == ("b", "Bob", "")
    assert after.notice_number > before.notice_number and after.notice == reasons.control_given_over("Bob", "Ada")


def test_a_request_for_control_is_told_granted_and_forgotten_in_time():
    it = authority()
    it.claim(ADA, 0.0)
    assert ask(it, intents.RequestControl(user="Bob", client="b"), 0.1) is None
    assert (it.message(0.1).requested_by, it.message(0.1).requested_key) == ("Bob", "b")
    for second in range(40):
        assert it.review(presence(second + 1, second * 0.9, ada()), True, second * 0.9) is None
    assert (it.message(36.0).requested_by, it.message(36.0).holder) == ("", "a")
    assert ask(it, intents.RequestControl(user="Bob", client="b"), 36.0) is None
    assert ask(it, intents.GrantControl(user="Ada", client="a"), 36.0) is None
    assert it.message(36.0).next_user == "Bob"


def test_control_is_given_back_by_who_holds_it():
    it = authority()
    it.claim(ADA, 0.0)
    assert ask(it, intents.ReturnControl(user="Bob", client="b"), 0.1) == reasons.control_not_yours()
    assert ask(it, intents.ReturnControl(user="Ada", client="a"), 0.1) is None
    assert not it.held


def test_somebody_who_has_seen_nothing_yet_is_told_so():
    it = authority()
    it.review(presence(1, 5.0, ada(age=NEVER_SEEN_S)), True, 5.0)
    assert it.unwatched(5.2) == reasons.never_watched(2.0)
