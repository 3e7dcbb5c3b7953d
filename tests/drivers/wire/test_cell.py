"""Published forms of `+CPSI:`, and invalid ones."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.wire.cell import Access, Leg, Strength, cell_report
from tests.drivers.wire.at.test_port import CAPTURED

LTE = "+CPSI: LTE,Online,460-11,0x5A1E,187214780,257,EUTRAN-BAND3,1850,5,5,-94,-850,-545,15"
SA = "+CPSI: NR5G_SA,Online,242-12,0x765D,4955280,0,NR5G_BAND78,640704,-770,-110,290"
LEG = "+CPSI: NR5G_NSA,644,NR5G_BAND78,627264,-960,-120,95"


def plain(value):
    """Return the known fields in the notation of the captures."""
    if isinstance(value, Access):
        return value.value
    if isinstance(value, Strength | Leg):
        return {name: plain(one) for name, one in value._asdict().items() if one is not None}
    return value


@pytest.mark.parametrize("capture", CAPTURED["cells"], ids=lambda capture: capture["lines"][-1][7:40])
def test_every_captured_form_is_read(capture):
    cell = cell_report(capture["lines"])
    wanted = {name: value for name, value in capture.items() if name != "lines"}
    assert {name: plain(getattr(cell, name)) for name in wanted} == wanted


def test_an_mnc_keeps_its_zeros():
    assert cell_report([SA.replace("242-12", "242-002")]).plmn == "242-002"


def test_the_second_field_and_not_the_count_of_fields_says_whether_a_line_is_a_leg():
    assert cell_report([LTE, LEG + ",1,12,0,0,0"]).access is Access.NSA


def test_a_strength_that_is_not_said_is_none():
    cell = cell_report([LTE.replace("-94,-850,-545,15", ",,,")])
    assert cell.strength == Strength()


@pytest.mark.parametrize("mode", ["Offline", "Factory Test Mode", "Reset", "Low Power Mode"])
def test_the_modem_may_be_in_another_mode(mode):
    assert cell_report([LTE.replace("Online", mode)]).mode == mode


def test_a_gsm_cell_has_what_all_have():
    cell = cell_report(
        ["+CPSI: GSM,Online,460-00,0x182D,12401,27 EGSM 900,-64,2110,42-42"]
    )  # as modules without 5G say it
    assert (cell.access, cell.plmn, cell.area, cell.cell, cell.band) == (
        Access.GSM,
        "460-00",
        0x182D,
        12401,
        "27 EGSM 900",
    )


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ([], "without a serving cell"),
        (["+CPSI: NOT IN EN-DC CONNECTED MODE"], "without a serving cell"),
        ([LEG], "without a serving cell"),
        ([LTE, SA], "a second serving cell"),
        ([SA, LEG], "beside a serving cell of 5g-sa"),
        (["+CSQ: 20,99"], "not a .CPSI line"),
        (["+CPSI: 6G,Online"], "unknown radio access"),
        (["+CPSI: LTE,Online,460-11"], "3 columns"),
        ([LTE.rpartition(",")[0]], "13 columns"),
        ([LTE.replace("460-11", "46011")], "invalid MCC-MNC"),
        ([LTE.replace("0x5A1E", "0x5G")], "base 16"),
        ([LTE.replace("187214780", "0xB28")], "base 10"),
        (["+CPSI: NR5G,Online,311-480,0x2D18,50896642,257,629952,-92,-11"], "9 columns"),
        (['+CPSI: LTE,"Online'], "quote"),
    ],
)
def test_what_is_no_report_is_said_to_be_none(lines, why):
    with pytest.raises(ProtocolError, match=why):
        cell_report(lines)


@given(
    lines=st.lists(
        st.lists(
            st.sampled_from(
                ["LTE", "NR5G", "NR5G_SA", "NR5G_NSA", "WCDMA", "GSM", "Online", "460-01", "0x1F", "7", "-900", ""]
            )
            | st.text(max_size=8),
            max_size=16,
        ),
        max_size=3,
    )
)
def test_any_line_is_read_or_explained(lines):
    try:
        cell_report("+CPSI: " + ",".join(line) for line in lines)
    except ProtocolError as error:
        assert error.message
