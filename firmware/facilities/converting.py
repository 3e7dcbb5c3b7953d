"""Conversion of received messages to the JSON of users, in both forms."""

import json
from collections.abc import Container, Iterator, Mapping

from firmware.codec.decoding import Decoder, UndecodableError, doubt_record, joined, refusal_record
from firmware.codec.library import Library
from firmware.codec.reading import Pdu
from firmware.facilities.exchange import MAX_BODY, Received, reception_of
from firmware.topics import JSON_FORMS, PLAIN


class Converter:
    """Converts received messages.

    library  the message library.
    """

    def __init__(self, library: Library) -> None:
        self._decoder = Decoder(library)

    def convert(self, one: Received, wanted: Container[bytes]) -> Iterator[tuple[bytes, bytes]]:
        """Yield topic and JSON object of a message, in each form that users want.

        edition    edition of the message.
        type       message type.
        form       `plain` on `plain.<type>.`; absent on `json.<type>.`.
        reception  how the message was received.
        message    decoded message; absent if it cannot be decoded.
        error      reason why the message cannot be decoded, or why its JSON is too long; absent if it is decoded.
        hint       likeliest cause, or the remedy; only with `error`.
        pdu        octets of the message, hexadecimal; only with `error`.
        """
        topics = {form: f"{form}.{one.type}.".encode() for form in JSON_FORMS}
        forms = [form for form in JSON_FORMS if topics[form] in wanted]
        reception = reception_of(one)
        pdu = Pdu(one.pdu, one.interface, one.btp_port)
        try:
            found = self._decoder.identify(pdu, is_quick=True)
        except UndecodableError as error:
            body = _unreadable(refusal_record(error), one, reception)
            yield from ((topics[form], body) for form in forms)
            return
        head: dict[str, object] = {"edition": found.message.name, "type": found.message.type, "reception": reception}
        head |= doubt_record(found)
        for form in forms:
            told = head | {"form": PLAIN} if form == PLAIN else head
            body = joined(told, "message", found.message.to_json(one.pdu, plain=form == PLAIN)).encode()
            if len(body) > MAX_BODY:
                told = {"error": f"JSON of {len(body)} octets; at most {MAX_BODY}", "hint": "decode `pdu`"}
                body = _unreadable(told, one, reception)
            yield topics[form], body


def _unreadable(told: Mapping[str, object], one: Received, reception: dict[str, object]) -> bytes:
    return json.dumps({**told, "type": one.type, "pdu": one.pdu.hex(), "reception": reception}).encode()
