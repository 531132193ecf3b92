"""The site: links that lead nowhere are found; the gallery has every entry, its picture, and the commands that made it."""

import importlib.util

import pytest

from pgfmd.scene import shipped_scenes
from scripts.studies import pages
from scripts.studies.site import run
from scripts.studies.site.entries import ENTRIES

SPEC = importlib.util.spec_from_file_location("check_links", pages.DOCS / "check_links.py")
check_links = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_links)


@pytest.mark.parametrize(
    ("link", "fault"),
    [
        ('<a href="b/two.html#there%20is">', None),
        ('<a href="#top">', None),
        ('<a href="b/">', None),
        ('<a href="https://example.org/none.html#nowhere">', None),
        ('<a href="mailto:a@b.c">', None),
        ('<a href="b/two.html#gone">', "b/two.html#gone: the page has no such anchor"),
        ('<a href="#gone">', "#gone: the page has no such anchor"),
        ('<a href="../one.html">', "../one.html: there is no such file"),
        ('<video poster="b/gone.png">', "b/gone.png: there is no such file"),
        ('<img src="b/gone.png">', "b/gone.png: there is no such file"),
    ],
)
def test_a_link_that_leads_nowhere_is_found(tmp_path, link, fault):
    (tmp_path / "b").mkdir()
    (tmp_path / "one.html").write_text(f'<h1 id="top">\n{link}', encoding="utf-8")
    (tmp_path / "b" / "two.html").write_text('<a href="index.html"></a><h2 id="there is">', encoding="utf-8")
    (tmp_path / "b" / "index.html").write_text('<a href="../one.html#top"></a>', encoding="utf-8")
    assert list(check_links.dead_links(tmp_path)) == ([f"one.html:2: {fault}"] if fault else [])


def test_the_gallery_is_that_of_the_script():
    page = run.PAGE.read_text(encoding="utf-8")
    filled = pages.filled(pages.filled(page, "thumbnails", run.thumbnails), "gallery", run.block)
    assert page == filled, "python -m scripts.studies.site.run --text writes the page anew"
    assert page.count("<!-- gallery ") == len(ENTRIES)


def test_pictures_are_there_and_small():
    assert {path.stem for path in run.PICTURES.iterdir()} == set(ENTRIES)
    for path in run.PICTURES.iterdir():
        assert path.read_bytes().startswith(b"\x89PNG")
        assert path.stat().st_size <= run.LARGEST
    assert run.MOVIE.read_bytes()[4:8] == b"ftyp"
    assert run.MOVIE.stat().st_size <= run.LARGEST_MOVIE


def test_every_shipped_scene_is_shown():
    page = (pages.DOCS / "reference" / "shipped_scenes.md").read_text(encoding="utf-8")
    for name in shipped_scenes():
        assert f"## {name}\n" in page
        assert f"pgfmd/scenes/{name}.toml" in page
    assert {entry.scene for entry in ENTRIES.values()} <= set(shipped_scenes())
