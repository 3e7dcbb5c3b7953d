"""Patients: those that do not recover, or had no trouble, are named."""

import random

from tests.proof.chaos.patient import Pace, Patient, Phase

ALWAYS = Pace(mean_s=5.0, longest_s=5.0, share_long=1.0, gap_s=2.0, share_again=0.0)
LIMIT_S, SETTLE_S, STEP_S = 10.0, 3.0, 0.5


class PaperTheatre:
    """A module that is up but while it is told to be ill, and heal_s longer; in_fault: until it is pulled out."""

    def __init__(self, heal_s: float = 1.0) -> None:
        self.time = 0.0
        self.heal_s = heal_s
        self.well_at = 0.0
        self.in_fault = False
        self.obeyed: list[str] = []

    def now(self) -> float:
        return self.time

    def obey(self, text: str) -> None:
        self.obeyed.append(text)
        if text == "begin radio unplugged":
            self.in_fault = False
        self.well_at = float("inf") if text.startswith("begin") else self.time + self.heal_s

    def is_up(self, name: str) -> bool:
        return self.time >= self.well_at and not self.in_fault

    def is_in_fault(self, name: str) -> bool:
        return self.in_fault

    def patient(self, pace: Pace = ALWAYS) -> Patient:
        return Patient(self, "radio", ["away"], LIMIT_S, SETTLE_S, random.Random(1), pace=pace)

    def play(self, patient: Patient, seconds: float) -> Patient:
        for _ in range(int(seconds / STEP_S)):
            self.time += STEP_S
            patient.tick()
        return patient


def test_an_episode_has_how_long_it_was_down_and_within_what_it_was_back() -> None:
    theatre = PaperTheatre(heal_s=2.0)
    patient = theatre.play(theatre.patient(), 40)
    first = patient.episodes[0]
    assert (first.troubles, first.lasted_s, first.back_s, first.replugs) == ("away", 5.0, 2.0, 0)
    assert 7.0 - STEP_S <= first.down_s <= 7.0
    assert first.is_ok
    assert theatre.obeyed[:2] == ["begin radio away", "end radio away"]


def test_one_that_is_back_too_late_is_no_good() -> None:
    theatre = PaperTheatre(heal_s=LIMIT_S + 1)
    patient = theatre.play(theatre.patient(), 40)
    assert not patient.episodes[0].is_ok


def test_one_that_does_not_come_back_is_overdue() -> None:
    theatre = PaperTheatre(heal_s=1000.0)
    patient = theatre.play(theatre.patient(), 40)
    assert patient.overdue == "radio is not back 10 s after away"


def test_one_that_goes_without_trouble_is_noticed() -> None:
    theatre = PaperTheatre()
    patient = theatre.patient()
    patient.is_over = True
    theatre.play(patient, 5)
    theatre.well_at = 7.0
    theatre.play(patient, 20)
    assert patient.unexplained == [5.5]
    assert patient.phase is Phase.WELL


def test_one_whose_slot_gave_up_is_pulled_out_and_put_back_once() -> None:
    theatre = PaperTheatre()
    patient = theatre.patient()
    while patient.phase is not Phase.RECOVERING:
        theatre.play(patient, STEP_S)
    theatre.in_fault = True
    patient.is_over = True
    theatre.play(patient, 20)
    assert theatre.obeyed[2:] == ["begin radio unplugged", "end radio unplugged"]
    assert (patient.episodes[0].replugs, patient.episodes[0].is_ok) == (1, True)


class AlwaysUp(PaperTheatre):
    def is_up(self, name: str) -> bool:
        return True


def test_a_short_trouble_that_nobody_notices_is_an_episode_too() -> None:
    theatre = AlwaysUp(heal_s=0.0)
    patient = theatre.play(theatre.patient(), 40)
    assert {(one.down_s, one.back_s) for one in patient.episodes} == {(0.0, 0.0)}
