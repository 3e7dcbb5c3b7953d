import pytest

from board.runtime.errors import RequestError
from firmware.codec.library import NoLibraryError, editions, load
from tests.firmware.codec.standin import BARE, DOOR, NEW, OLD, SAME


def test_a_program_without_the_library_says_how_to_get_it(without_library):
    with pytest.raises(NoLibraryError) as told:
        load()
    assert "make codec" in told.value.hint
    assert len(str(told.value).splitlines()) == 2


def test_all_messages_stand_by_type_and_preference(standin):
    found = [(message.type, message.rank) for message in editions(load(), None)]
    assert found == [("ball", 1), ("ball", 1), ("ball", 2), ("bare", 1), ("door", 1)]


@pytest.mark.parametrize(
    ("asked", "found"),
    [("ball-1.1", [OLD]), ("BALL-1.1", [OLD]), ("door", [DOOR]), ("ball", [NEW, SAME, OLD]), ("bare", [BARE])],
)
def test_an_edition_or_all_of_a_type_may_be_asked_for(standin, asked, found):
    assert editions(standin, asked) == found


@pytest.mark.parametrize(
    ("asked", "remedy"),
    [("ball-1.3", "did you mean ball-1.2?"), ("door-of-the-barn", "known: door-1.1; "), ("xyz", "known: ball, ")],
)
def test_an_edition_that_is_not_there_is_refused_with_what_is(standin, asked, remedy):
    with pytest.raises(RequestError) as told:
        editions(standin, asked)
    assert f"unknown edition {asked!r}" in told.value.message
    assert remedy in told.value.hint
