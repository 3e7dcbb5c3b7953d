"""Output format docs: pages in Markdown."""

from pathlib import Path

from asn1.backends.backend import Job, Progress
from asn1.backends.output import FileBackend


class Pages(FileBackend):
    """One page per message, and README.md that lists them."""

    name = "docs"
    summary = "pages, a Markdown file per message"
    next_step = "begin with {folder}/README.md"

    def steps(self, job: Job) -> int:
        return len(job.messages)

    def fill(self, job: Job, folder: Path, progress: Progress) -> None:
        from asn1.backends.docs import pages

        pages.write(job.schema, job.messages, folder, progress)
