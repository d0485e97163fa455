"""The users file lets in who knows the password, holds none, and is changed from the command line."""

import io
import stat

import pytest

from rolling_panda.errors import InputError
from rolling_panda.runtime.state_folder import usual_state_folder
from server.auth.user_command import main
from server.auth.users import MAX_LENGTH, MIN_LENGTH, UserFile

PASSWORD = "correct horse battery"


@pytest.fixture
def users(tmp_path):
    file = UserFile(tmp_path / "state" / "cell" / "users.json")
    file.add("ada", "supervisor", PASSWORD)
    return file


def test_name_and_password_have_to_fit(users):
    assert users.check("ada", PASSWORD).role == "supervisor"
    assert users.check("ada", PASSWORD + " ") is None
    assert users.check("eve", PASSWORD) is None
    assert users.check("ada", "\ud800 no text") is None


def test_the_file_holds_no_password_and_is_for_its_owner_alone(users):
    content = users.path.read_text()
    assert "correct" not in content and "$argon2id$" in content
    assert stat.S_IMODE(users.path.stat().st_mode) == 0o600
    users.add("bob", "viewer", PASSWORD)
    hashes = {user.password for user in users.all()}
    assert len(hashes) == 2


def test_a_new_password_counts_at_once_and_the_old_one_no_more(users):
    before = users.all()[0].fingerprint
    users.set_password("ada", "another long one")
    assert users.check("ada", PASSWORD) is None and users.check("ada", "another long one")
    assert users.all()[0].fingerprint != before


def test_who_is_removed_is_gone(users):
    users.add("bob", "viewer", PASSWORD)
    users.remove("ada")
    assert users.check("ada", PASSWORD) is None
    assert [user.name for user in users.all()] == ["bob"]


def test_what_cannot_be_is_refused_in_words(users):
    with pytest.raises(InputError, match="there is a user 'ada' already"):
        users.add("ada", "viewer", PASSWORD)
    with pytest.raises(InputError, match="10 to 200 characters; this one has 5"):
        users.add("bob", "viewer", "short")
    for name in ("", " bob", "b\nob", "<b>", "x" * 41):
        with pytest.raises(InputError, match="is no name"):
            users.add(name, "viewer", PASSWORD)
    with pytest.raises(InputError, match="no user 'eve'.*there are ada"):
        users.remove("eve")
    users.path.write_text("{")
    with pytest.raises(InputError, match="is no users file"):
        users.all()


def run(monkeypatch, capsys, *words, typed=""):
    monkeypatch.setattr("sys.stdin", io.StringIO(typed))
    code = main(words)
    told = capsys.readouterr()
    return code, told.out + told.err


def test_the_command_adds_lists_changes_and_removes(tmp_path, monkeypatch, capsys):
    state = ("--state", str(tmp_path))
    code, told = run(monkeypatch, capsys, "add", "ada", "--role", "supervisor", "--password-stdin", *state,
                     typed=PASSWORD + "\n")  # fmt: skip
    assert code == 0 and "ada may sign in as supervisor" in told and PASSWORD not in told
    file = UserFile(tmp_path / "users.json")
    assert file.check("ada", PASSWORD)
    file.add("bob", "viewer", PASSWORD)
    assert run(monkeypatch, capsys, "list", *state) == (0, "supervisor  ada\nviewer      bob\n")
    file.remove("bob")
    assert run(monkeypatch, capsys, "password", "ada", "--password-stdin", *state, typed="much longer one\n")[0] == 0
    assert file.check("ada", "much longer one")
    assert run(monkeypatch, capsys, "remove", "ada", *state)[0] == 0
    assert run(monkeypatch, capsys, "list", *state) == (0, "nobody may sign in\n")
    code, told = run(monkeypatch, capsys, "remove", "ada", *state)
    assert code == 1 and "no user 'ada'" in told and len(told.splitlines()) == 1


def test_a_password_is_asked_for_twice(tmp_path, monkeypatch, capsys):
    typed = iter([PASSWORD, "something else", PASSWORD, PASSWORD])
    monkeypatch.setattr("getpass.getpass", lambda prompt: next(typed))
    code, told = run(monkeypatch, capsys, "add", "ada", "--state", str(tmp_path))
    assert code == 1 and "differ" in told and not (tmp_path / "users.json").exists()
    assert run(monkeypatch, capsys, "add", "ada", "--state", str(tmp_path))[0] == 0
    assert UserFile(tmp_path / "users.json").check("ada", PASSWORD)


@pytest.mark.parametrize("given_up", [KeyboardInterrupt, EOFError])
def test_who_gives_up_at_the_password_changes_nothing(tmp_path, monkeypatch, capsys, given_up):
    def ask(prompt):
        raise given_up

    monkeypatch.setattr("getpass.getpass", ask)
    code, told = run(monkeypatch, capsys, "add", "ada", "--state", str(tmp_path))
    assert code == 1 and "nothing was changed" in told and not (tmp_path / "users.json").exists()


@pytest.mark.parametrize("password", [f"{PASSWORD}\r ", f"{PASSWORD} X"])
def test_without_a_folder_the_users_are_those_of_the_robots_state(tmp_path, monkeypatch, capsys, password):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    words = ("add", "ada", "--robot-id", "rp7", "--password-stdin")
    assert run(monkeypatch, capsys, *words, typed=f"{password}\n")[0] == 0
    file = UserFile(tmp_path / "rolling-panda" / "rp7" / "users.json")
    assert file.check("ada", password) and file.check("ada", PASSWORD) is None
    assert "supervisor" not in run(monkeypatch, capsys, "list", "--robot-id", "rp7")[1]


def test_a_command_has_to_be_named_and_the_help_names_the_folder_of_the_users(capsys):
    with pytest.raises(SystemExit) as refused:
        main([])
    assert refused.value.code == 2
    assert "COMMAND" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["add", "--help"])
    told = "".join(capsys.readouterr().out.split())
    assert "".join(str(usual_state_folder("ROBOT_ID")).split()) in told


def test_a_password_of_the_least_and_of_the_greatest_length_will_do(users):
    for name, length in (("short", MIN_LENGTH), ("long", MAX_LENGTH)):
        users.add(name, "viewer", "x" * length)
        assert users.check(name, "x" * length)
    for length in (MIN_LENGTH - 1, MAX_LENGTH + 1):
        with pytest.raises(InputError, match=f"this one has {length}"):
            users.add("other", "viewer", "x" * length)


def test_folders_made_for_the_file_are_for_their_owner_alone(users):
    assert stat.S_IMODE(users.path.parent.stat().st_mode) == 0o700


def test_a_file_that_is_no_users_file_lets_nobody_in(tmp_path):
    folder, binary = UserFile(tmp_path), UserFile(tmp_path / "binary")
    with pytest.raises(InputError, match="cannot read the users file .*: Is a directory"):
        folder.all()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="cannot write the users file .*: File exists"):
        UserFile(tmp_path / "link" / "users.json").add("ada", "viewer", PASSWORD)
    binary.path.write_bytes(b'{"users":[{"name":"\xff"}]}')
    with pytest.raises(InputError, match="is no users file"):
        binary.all()
    binary.path.write_text('{"users":[{"name":"ada","role":"viewer","password":"as typed"}]}')
    assert binary.check("ada", "as typed") is None


def test_of_nobody_there_is_nobody_to_name(tmp_path):
    with pytest.raises(InputError, match="there are nobody"):
        UserFile(tmp_path / "users.json").remove("eve")
