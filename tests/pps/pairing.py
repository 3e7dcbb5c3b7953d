"""Words of receivers for tests of the pairing, and its refusals."""

from pps.refused import Refused


def whys(events):
    return [event.why for event in events if isinstance(event, Refused)]


def but(said, *changes):
    """The words of some seconds with others in place of those that come at the same moment; None: left out."""
    kept = {one.at: one for one in said}
    for change in changes:
        kept[change.at] = change
    return [one for one in kept.values() if one.what is not None]


def without(said, *kinds):
    return [one for one in said if not isinstance(one.what, kinds)]
