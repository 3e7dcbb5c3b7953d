"""A list of addresses is as good as a directory."""

from pathlib import Path

import pytest

from asn1.importer.download import directory_of
from asn1.importer.parser.fault import ImportFault


def listed(folder: Path, words: str) -> Path:
    path = folder / "modules.txt"
    path.write_text(words)
    return path


def test_a_directory_is_taken_as_it_is(tmp_path: Path) -> None:
    with directory_of(tmp_path) as found:
        assert found == tmp_path


def test_every_address_becomes_a_file_that_goes_away_again(tmp_path: Path) -> None:
    source = listed(tmp_path, "# comment\n\nr1/cam/CAM.asn https://a.example/CAM.asn\nx.asn https://a.example/x\n")
    with directory_of(source, fetch=str.encode) as found:
        assert (found / "r1/cam/CAM.asn").read_bytes() == b"https://a.example/CAM.asn"
        assert (found / "x.asn").read_bytes() == b"https://a.example/x"
    assert not found.exists()


def test_every_address_that_fails_is_told_with_its_line(tmp_path: Path) -> None:
    def fetch(address: str) -> bytes:
        raise OSError("unreachable")

    source = listed(tmp_path, "a.asn https://a.example/a\nb.asn https://a.example/b\n")
    with pytest.raises(ImportFault) as error, directory_of(source, fetch):
        pass
    assert str(error.value).splitlines() == [
        "modules.txt:1: https://a.example/a: unreachable",
        "modules.txt:2: https://a.example/b: unreachable",
    ]


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("a.asn", "expected <path> <https address>"),
        ("a.asn http://a.example/a", "expected <path> <https address>"),
        ("a.asn file:///etc/passwd", "expected <path> <https address>"),
        ("../a.asn https://a.example/a", "../a.asn is outside the download directory; use a relative path without .."),
        ("/a.asn https://a.example/a", "/a.asn is outside the download directory; use a relative path without .."),
    ],
)
def test_a_line_that_is_none_is_refused(tmp_path: Path, line: str, problem: str) -> None:
    with pytest.raises(ImportFault) as error, directory_of(listed(tmp_path, line), fetch=str.encode):
        pass
    assert str(error.value) == f"modules.txt:1: {problem}"
