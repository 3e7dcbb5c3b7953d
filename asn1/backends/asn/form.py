"""Output format asn: ASN.1 text."""

from pathlib import Path

from asn1.backends.backend import Job, Progress
from asn1.backends.output import FileBackend


class AsnText(FileBackend):
    """One file of ASN.1 text for each module that the messages need."""

    name = "asn"
    summary = "ASN.1 text, for other compilers"
    next_step = "one file per module"

    def fill(self, job: Job, folder: Path, progress: Progress) -> None:
        from asn1.backends.asn import text
        from asn1.model import selection

        progress("ASN.1 text")
        text.write(selection.part(job.schema, job.messages), folder)
