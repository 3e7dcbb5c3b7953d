"""Message types of both profiles, as existing boxes and TS 103 248 have them."""

# messageID, name, BTP port in profile standard, in profile legacy; None: not sent.
TABLE: list[tuple[int, str, int, int | None]] = [
    (1, "denm", 2002, 2002),
    (2, "cam", 2001, 2001),
    (3, "poi", 2010, 2010),
    (4, "spatem", 2004, 2004),
    (5, "mapem", 2003, 2003),
    (6, "ivim", 2006, 2006),
    (7, "ev_rsr", 2012, 2012),
    (8, "tistpgtransaction", 2011, None),
    (9, "srem", 2007, 2007),
    (10, "ssem", 2008, 2008),
    (11, "evcsn", 2010, 2010),
    (12, "saem", 2005, 2005),
    (13, "rtcmem", 2013, 2013),
    (14, "cpm", 2009, 2001),
    (15, "imzm", 2019, None),
    (16, "vam", 2018, 2001),
    (20, "mcm", 2017, None),
    (102, "vam", 2018, 2001),
]
NAMELESS_IN_LEGACY = {15, 20}  # ids that had no name once
