"""captain convert: converts messages from one format to another."""

import argparse

from firmware.client.show.failures import Failures
from firmware.codec import library, writing
from firmware.codec.arguments import FORMS_HELP, add_edition, add_input, each
from firmware.codec.decoding import Decoder
from firmware.codec.encoding import Wish, pdu_from
from firmware.codec.foreign import message_frame
from firmware.codec.reading import Object, Pdu, pdu_of

DESCRIPTION = f"""\
Writes messages in another format: hexadecimal, base64, binary, JSON (decoded),
pcap (GeoNetworking in Ethernet frames). The octets of a message do not change:
it is never converted to another edition of its standard.

{FORMS_HELP}
A JSON object may have `edition` and `message` in place of the octets.
"""
EPILOG = """\
examples:
  captain convert drive.pcapng --to hex       the messages of a capture
  captain convert drive.pcapng -o drive.jsonl
                                              decoded, one object per line
  captain convert cams.hex -o cams.pcap       for Wireshark
  captain convert --format base64 --to hex AgIAAAU5AAECAw==
  captain convert drive.jsonl -o denm.b64 --edition denm
                                              refuses other types than DENM

exit codes:
  0    every message was converted
  1    a message was not converted (the others were), or the input was empty
  2    wrong usage
  130  Ctrl-C
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    add_input(parser)
    writing.add_output(parser)
    add_edition(parser)


def main(arguments: argparse.Namespace) -> int:
    failures = Failures()
    conversion = Conversion(arguments.edition, failures, arguments.force)
    with writing.output(arguments, "hex") as out:

        def convert(item: Pdu | Object) -> None:
            pdu = conversion.octets(item)
            if out.keeps_octets and (other := message_frame(pdu.octets)) is not None:
                failures.warn(f"{pdu.origin}: {other}")
            out.write(pdu)

        return each(arguments, convert, failures=failures)


class Conversion:
    """Converts input items to PDUs; loads the message library only when an item needs it.

    edition    value of `--edition`: all messages must be of it; None: any edition.
    failures   receives warnings about encoded messages.
    is_forced  `--force`: ignore the header.
    """

    def __init__(self, edition: str | None, failures: Failures, is_forced: bool = False) -> None:
        self._edition = edition
        self._failures = failures
        self._is_forced = is_forced
        self._decoder: Decoder | None = None

    def octets(self, item: Pdu | Object) -> Pdu:
        """Return the PDU of an item. Raises RequestError if it has none, or is not of the edition."""
        pdu = self._from_json(item) if isinstance(item, Object) else item
        if self._edition is not None:
            self._codec().identify(pdu, is_quick=True)
        return pdu

    def _from_json(self, one: Object) -> Pdu:
        """Return the PDU of a JSON object; given octets are preferred to fields, since they are exact."""
        if "message" not in one.value:
            return pdu_of(one)
        known = self._codec().known
        pdu, warning = pdu_from(one, Wish(known, self._edition, library.load().all(), self._is_forced))
        if warning:
            self._failures.warn(warning)
        return pdu

    def _codec(self) -> Decoder:
        if self._decoder is None:
            self._decoder = Decoder(library.load(), self._edition, self._is_forced)
        return self._decoder
