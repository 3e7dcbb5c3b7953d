"""Questions to a receiver: one at a time, repeated, answered only by their own answer."""

import pytest

from drivers.gnss.conversation import Conversation
from drivers.wire.ublox.messages import Ack, Nak, RxmRtcm

ACK, NAK = Ack(6, 0x8A), Nak(6, 0x8A)


def is_about(message):
    return isinstance(message, Ack | Nak)


class Talk:
    """Conversation with a receiver, with lists of written octets and answers."""

    def __init__(self, loop):
        self.loop = loop
        self.written = []
        self.answers = []
        self.talk = Conversation(loop, self.written.append)

    def ask(self, octets, tries=3):
        self.talk.ask(octets, is_about, lambda answer: self.answers.append((octets, answer)), tries)


@pytest.fixture
def talk(loop):
    loop.patience_s = 0.0
    return Talk(loop)


def test_a_question_waits_for_the_answer_of_the_one_before(talk):
    talk.ask(b"1")
    talk.ask(b"2")
    assert talk.written == [b"1"]
    talk.talk.hear(RxmRtcm(2, 4, 0, 0, 1005))
    assert talk.answers == []
    talk.talk.hear(ACK)
    talk.talk.hear(NAK)
    assert talk.written == [b"1", b"2"]
    assert talk.answers == [(b"1", ACK), (b"2", NAK)]


def test_a_question_without_an_answer_is_asked_again_and_then_given_up(talk, loop):
    talk.ask(b"1")
    talk.ask(b"2")
    loop.run_for(2.5)
    assert talk.written == [b"1"] * 3
    loop.run_for(1)
    assert talk.answers == [(b"1", None)]
    assert talk.written == [b"1"] * 3 + [b"2"]


def test_the_second_answer_to_a_repeated_question_is_not_taken_for_that_of_the_next(talk, loop):
    talk.ask(b"1")
    loop.run_for(1.5)
    talk.ask(b"2")
    talk.talk.hear(ACK)
    assert talk.answers == [(b"1", ACK)]
    assert talk.written == [b"1", b"1"]
    talk.talk.hear(ACK)  # answer to the repetition
    loop.run_for(1.1)
    assert talk.written == [b"1", b"1", b"2"]
    talk.talk.hear(NAK)
    assert talk.answers == [(b"1", ACK), (b"2", NAK)]


def test_what_is_asked_from_inside_an_answer_comes_next(talk, loop):
    talk.talk.ask(b"1", is_about, lambda answer: talk.ask(b"2"))
    talk.talk.hear(ACK)
    assert talk.written == [b"1", b"2"]
    talk.talk.hear(ACK)
    assert talk.answers == [(b"2", ACK)]


def test_closed_it_says_nothing_more(talk, loop):
    talk.ask(b"1")
    talk.ask(b"2")
    talk.talk.close()
    talk.talk.close()
    talk.talk.hear(ACK)
    loop.run_for(10)
    assert (talk.written, talk.answers) == ([b"1"], [])
    talk.ask(b"3")
    assert talk.written == [b"1", b"3"]
