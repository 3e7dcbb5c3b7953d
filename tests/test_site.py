"""Check of the built site, on small sites."""

from pathlib import Path

import pytest

from tests import site

INDEX = 'Search.setIndex({"terms": {"mosquitto": 3}})'


def made(folder: Path, **pages: str) -> Path:
    for name, text in pages.items():
        (folder / f"{name}.html").write_text(text)
    (folder / "searchindex.js").write_text(INDEX)
    return folder


def test_site_with_links_between_pages_has_no_problem(tmp_path: Path):
    pages = {"a": '<a href="b.html#x">b</a> <a href="https://example.org/">out</a>', "b": '<h1 id="x">B</h1>'}
    assert site.problems(made(tmp_path, **pages)) == []


def test_site_with_absent_page_and_anchor_reports_both(tmp_path: Path):
    pages = {"a": '<a href="none.html"></a><a href="b.html#y"></a><a href="#z"></a>', "b": '<h1 id="x">B</h1>'}
    assert site.problems(made(tmp_path, **pages)) == [
        "a.html: broken anchor: #z",
        "a.html: broken anchor: b.html#y",
        "a.html: broken link: none.html",
    ]


@pytest.mark.parametrize(
    "text",
    [
        '<script src="https://cdn.example.org/x.js"></script>',
        '<link rel="stylesheet" href="//fonts.example.org/x.css">',
        '<img src="http://example.org/x.png">',
    ],
)
def test_site_that_loads_from_elsewhere_reports_the_address(text: str, tmp_path: Path):
    (found,) = site.problems(made(tmp_path, a=text))
    assert found.startswith("a.html: loads ")


def test_style_sheet_that_loads_from_elsewhere_is_reported(tmp_path: Path):
    (tmp_path / "x.css").write_text("@font-face { src: url('https://example.org/f.woff2') }")
    assert site.problems(made(tmp_path)) == ["x.css: loads https://example.org/f.woff2"]


def test_search_index_is_asked_for_a_whole_word(tmp_path: Path):
    assert site.is_found("mosquitto", made(tmp_path))
    assert not site.is_found("mosquit", tmp_path)
