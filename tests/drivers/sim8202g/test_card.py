"""SIM of the modem: its PIN is entered only if that is safe."""

import os

import pytest

from board.runtime.errors import InterfaceError
from drivers.sim.modem.commands import ICCID
from tests.said import tells

PATIENCE_S = 0.0  # ptys tell when octets are on their way
OTHER_ICCID = ICCID[:-1] + "1"


@pytest.fixture
def bench(make_modem):
    return make_modem()


@pytest.fixture
def locked(make_modem, tmp_path):
    def locked(pin="1234", **options):
        bench = make_modem(pin_file=str(write(tmp_path, pin)), **options)
        bench.modem.card.state = "SIM PIN"
        return bench

    return locked


def write(folder, pin):
    path = folder / "pin"
    path.write_text(f"{pin}\n")
    path.chmod(0o600)
    return path


def restart(bench):
    """Restart the driver, as a restart of the station does."""
    bench.driver.stop()
    bench.station.begin()


def lies(bench, command, *answers):
    """Make the modem give these answers to a command in turn, and then the correct one."""
    left = list(answers)

    def lie(text):
        return f"\r\n{left.pop(0)}\r\n" if text.startswith(command) and left else None

    bench.modem.lies = lie


def test_a_pin_is_given_once(locked):
    bench = locked()
    bench.up()
    assert bench.modem.card.tries == ["1234"]
    assert bench.modem.card.attempts == 3


def test_a_pin_that_was_refused_is_never_tried_again_whatever_happens(locked, tmp_path, loop):
    bench = locked(pin="0000")
    bench.start()
    loop.run_until(lambda: "refused" in bench.station.why)
    loop.run_for(3600)
    bench.station.fail(InterfaceError("something else"))
    loop.run_for(600)
    bench.modem.crash()
    loop.run_for(600)
    assert bench.modem.card.tries == ["0000"]
    assert "not tried again" in bench.station.why


def test_a_pin_is_tried_again_when_the_file_holds_another(locked, tmp_path, loop):
    bench = locked(pin="0000")
    bench.start()
    loop.run_until(lambda: "refused" in bench.station.why)
    write(tmp_path, "1234")
    loop.run_until(lambda: bench.station.is_up)
    assert bench.modem.card.tries == ["0000", "1234"]


def test_the_last_attempts_of_a_card_are_not_ours(locked, tmp_path, loop):
    bench = locked()
    bench.modem.card.attempts = 1
    bench.start()
    loop.run_until(lambda: "allows only 1 more attempts" in bench.station.why)
    loop.run_for(3600)
    assert bench.modem.card.tries == []


def test_a_try_whose_end_nobody_knows_counts_as_refused_if_it_cost_an_attempt(locked, tmp_path, loop):
    bench = locked(pin="0000")
    bench.start()
    loop.run_until(lambda: bench.modem.card.tries)
    bench.modem.crash()  # before it has said anything
    loop.run_until(lambda: bench.station.failures)
    loop.run_for(300)
    assert bench.modem.card.tries == ["0000"]
    assert "refused this PIN before" in bench.station.why


def test_a_pin_that_nothing_can_be_written_down_about_is_not_tried(locked, tmp_path, loop):
    bench = locked(state_dir=str(tmp_path / "nowhere"))
    bench.start()
    loop.run_until(lambda: "cannot be written" in bench.station.why)
    assert bench.modem.card.tries == []


@pytest.mark.parametrize(
    ("pin", "mode", "why"), [("1234", 0o644, "lets others read"), ("12", 0o600, "no PIN"), ("12x4", 0o600, "no PIN")]
)
def test_a_pin_file_that_is_not_safe_is_not_used(locked, tmp_path, loop, pin, mode, why):
    bench = locked(pin)
    (tmp_path / "pin").chmod(mode)
    bench.start()
    loop.run_until(lambda: why in bench.station.why)
    assert bench.modem.card.tries == []


@pytest.mark.parametrize(
    ("state", "why"), [("SIM PIN", "needs its PIN"), ("SIM PUK", "PUK"), ("PH-NET PIN", "locked to another")]
)
def test_a_card_that_is_locked_blocks_and_is_said_once(bench, loop, state, why, caplog):
    bench.modem.card.state = state
    bench.start()
    loop.run_until(lambda: why in bench.station.why)
    said = len(set(bench.station.links))
    loop.run_for(3600)
    assert len(set(bench.station.links)) == said
    assert not bench.station.failures
    assert bench.modem.boots == 1


def test_a_card_that_is_put_in_is_noticed_at_once(bench, loop):
    bench.modem.card.is_there = False
    bench.start()
    loop.run_until(lambda: "SIM: absent" in bench.station.why)
    loop.run_for(35)
    bench.modem.card.is_there = True
    bench.modem.network.search()
    bench.modem.unsolicited("+CPIN: READY")
    loop.run_until(lambda: bench.station.is_up, within=20)


def test_a_card_that_is_taken_out_takes_the_link_down(bench, loop):
    bench.up()
    loop.run_for(90)
    bench.modem.card.is_there = False
    bench.modem.network.leave()
    bench.modem.unsolicited("+SIMCARD: NOT AVAILABLE")
    loop.run_until(lambda: not bench.station.is_up, within=20)
    loop.run_until(lambda: "SIM: absent" in bench.station.why)


@pytest.mark.parametrize("final", ["+CME ERROR: 14", "+CME ERROR: SIM busy", "ERROR", "+CME ERROR: 100"])
def test_a_pin_that_a_busy_card_did_not_look_at_is_given_again(locked, final):
    bench = locked()
    lies(bench, 'AT+CPIN="', final)
    bench.up()
    assert bench.modem.card.tries == ["1234"]


@pytest.mark.parametrize("final", ["+CME ERROR: 14", "ERROR"])
def test_an_error_that_cost_an_attempt_is_a_refusal_whatever_it_says(locked, final):
    bench = locked(pin="0000")
    card = bench.modem.card

    def lie(text):
        if not text.startswith('AT+CPIN="'):
            return None
        card.tries.append(text)
        card.attempts -= 1
        return f"\r\n{final}\r\n"

    bench.modem.lies = lie
    bench.start()
    bench.loop.run_until(lambda: "refused" in bench.station.why)
    bench.loop.run_for(600)
    assert len(card.tries) == 1


@pytest.mark.parametrize("state", ["SIM PIN2", "SIM PUK2"])
def test_a_second_pin_is_none_that_packets_need(locked, state):
    bench = locked()
    bench.modem.card.state = "READY"
    bench.modem.lies = lambda text: f"\r\n+CPIN: {state}\r\n\r\nOK\r\n" if text == "AT+CPIN?" else None
    bench.up()


@pytest.mark.parametrize(
    "answer", ["ERROR", "\r\nOK", "+CME ERROR: 13", "+CICCID: garbled\r\n\r\nOK", "12345\r\n\r\nOK"]
)
def test_at_a_card_that_does_not_say_which_it_is_no_pin_is_tried(locked, answer):
    bench = locked()
    bench.modem.lies = lambda text: f"\r\n{answer}\r\n" if text == "AT+CICCID" else None
    bench.start()
    bench.loop.run_until(lambda: "ICCID cannot be read" in bench.station.why)
    bench.loop.run_for(300)
    assert bench.modem.card.tries == []
    assert not bench.station.failures
    bench.modem.lies = lambda text: None
    bench.loop.run_until(lambda: bench.station.is_up)


def test_a_stray_line_beside_its_number_makes_no_other_card_of_it(locked):
    bench = locked(pin="0000")
    bench.start()
    bench.loop.run_until(lambda: "refused" in bench.station.why)
    bench.modem.lies = lambda text: (
        f"\r\n*COPN: 3\r\n\r\n+ICCID: {ICCID}\r\n\r\nOK\r\n" if text == "AT+CICCID" else None
    )
    restart(bench)
    bench.loop.run_for(600)
    assert bench.modem.card.tries == ["0000"]


def test_pin_that_was_refused_stays_refused_when_another_was_tried_since(locked, tmp_path):
    bench = locked(pin="0000")
    bench.modem.card.attempts = 10
    bench.start()
    for pin in ("0000", "1111", "0000", "1111"):
        write(tmp_path, pin)
        bench.loop.run_for(120)
        restart(bench)
        bench.loop.run_for(120)
    assert bench.modem.card.tries == ["0000", "1111"]
    assert tells(bench.station.why, "SIM", "refused", "PIN before")


def test_what_one_card_refused_another_is_given_and_the_first_never_again(locked):
    bench = locked(pin="0000")
    card = bench.modem.card
    bench.start()
    bench.loop.run_until(lambda: "refused" in bench.station.why)
    bench.modem.lies = lambda text: f"\r\n+ICCID: {OTHER_ICCID}\r\n\r\nOK\r\n" if text == "AT+CICCID" else None
    card.pin = "0000"
    bench.loop.run_until(lambda: bench.station.is_up)
    bench.modem.lies = lambda text: None
    card.pin, card.state = "1234", "SIM PIN"
    restart(bench)
    bench.loop.run_for(300)
    assert card.tries == ["0000", "0000"]


def test_a_try_is_on_the_disk_before_it_is_made(locked, monkeypatch):
    bench = locked()
    done = []
    for name in ("fsync", "rename"):
        real = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *given, name=name, real=real: (done.append(name), real(*given)))
    tries = bench.modem.card.tries
    monkeypatch.setattr(bench.modem.card, "tries", Noting(tries, done))
    bench.up()
    assert done[:4] == ["fsync", "rename", "fsync", "tried"]


class Noting(list):
    """List that adds `tried` to another list for each added item."""

    def __init__(self, start, done):
        super().__init__(start)
        self._done = done

    def append(self, one):
        self._done.append("tried")
        super().append(one)


def test_a_record_that_cannot_be_taken_back_harms_nothing(locked, tmp_path, monkeypatch):
    bench = locked()

    def lie(text):
        if text.startswith('AT+CPIN="'):
            (tmp_path / "1-1.2-pin.json").chmod(0o600)
            (tmp_path / "1-1.2-pin.new").mkdir()  # so that nothing can be written there

    bench.modem.lies = lie
    bench.up()
    assert bench.station.is_up


def test_a_fifo_is_no_pin_file_and_is_not_waited_for(locked, tmp_path):
    bench = locked()
    (tmp_path / "pin").unlink()
    os.mkfifo(tmp_path / "pin", 0o600)
    bench.start()
    bench.loop.run_until(lambda: "not a regular file" in bench.station.why)
    assert bench.modem.card.tries == []


@pytest.mark.parametrize("text", ["[]", "7", "{", '{"salt": 1}', '{"salt": "x", "cards": {"a": {"refused": 1}}}'])
def test_a_record_that_is_none_lets_no_pin_be_tried(locked, tmp_path, text):
    bench = locked()
    (tmp_path / "1-1.2-pin.json").write_text(text)
    bench.start()
    bench.loop.run_until(lambda: "cannot be read" in bench.station.why)
    assert bench.modem.card.tries == []


def test_a_refusal_that_is_looked_at_every_half_minute_is_not_written_every_time(locked, tmp_path):
    bench = locked(pin="0000")
    bench.start()
    bench.loop.run_until(lambda: "refused" in bench.station.why)
    path = tmp_path / "1-1.2-pin.json"
    inode = path.stat().st_ino
    bench.loop.run_for(600)
    assert path.stat().st_ino == inode
