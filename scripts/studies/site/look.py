"""Looks at the built pages in Chromium, at 400 and 1400 px, light and dark; fails if one is wider than the window, or the
search finds nothing.

    scripts/docs
    python -m scripts.studies.site.look                     # every page, narrow and wide
    python -m scripts.studies.site.look pages gallery       # and pictures of some into the folder pages/
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from scripts.studies.pages import DOCS
from tests.unit.chromium import Browser, executable

BUILT = DOCS / "_build" / "html"
WIDTHS = (400, 1400)
SHOWN = ("index", "gallery", "tutorials/quickstart", "tutorials/first_test", "how-to/fit", "explanation/model", "reference/scene",
         "reference/cli", "evidence/validation")  # fmt: skip
"""Pages of which there are pictures: one of each kind."""
OUTSIDE = """
[...document.querySelectorAll('.content *')].filter(element => {
    const box = element.getBoundingClientRect();
    if (box.width == 0 || box.right <= innerWidth + 1) return false;
    for (let above = element.parentElement; above; above = above.parentElement)
        if (['auto', 'scroll', 'hidden'].includes(getComputedStyle(above).overflowX) && above !== document.body) return false;
    return true;
}).map(element => element.tagName + ' ' + element.textContent.slice(0, 60)).slice(0, 3)
"""
"""What sticks out of the window, and can't be reached by scrolling the element that it is in."""


def faults_of(browser: Browser, page: Path) -> list[str]:
    """What is wrong with a page: wider than the window, parts out of reach, complaints of its scripts, dead pictures."""
    browser.open(page.as_uri())
    found = [fault for fault in map(str, browser.faults) if not fault.startswith("asks for file:")]
    for width in WIDTHS:
        if (over := browser.overflow(width)) > 0:
            found.append(f"{over} px wider than a window of {width}")
        found += [f"out of a window of {width}: {part}" for part in browser.run(OUTSIDE)]
    found += [f"no picture: {address}" for address in browser.run(
        "[...document.images].filter(image => image.complete && !image.naturalWidth).map(image => image.src)")]  # fmt: skip
    return found


def hits_of(browser: Browser, word: str) -> int:
    """How many pages the search finds."""
    browser.open(f"{(BUILT / 'search.html').as_uri()}?q={word}")
    return browser.run(
        "new Promise(done => { let last = -1, same = 0, left = 100; const look = () => {"
        "const found = document.querySelectorAll('#search-results li').length;"
        "same = found == last ? same + 1 : 0; last = found;"
        "(found && same > 10) || !left-- ? done(found) : setTimeout(look, 100); }; look(); })"
    )


def main() -> None:
    """Looks at all pages, and takes pictures of some."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("pictures", nargs="?", type=Path, metavar="DIR", help="folder for pictures")
    options.add_argument(
        "names", nargs="*", default=SHOWN, metavar="PAGE", help=f"to be taken; by default {', '.join(SHOWN)}"
    )
    given = options.parse_args()
    if executable() is None:
        raise SystemExit("no Chromium on PATH")
    bad = 0
    with tempfile.TemporaryDirectory() as folder, Browser(Path(folder)) as browser:
        for page in sorted(BUILT.rglob("*.html")):
            for fault in faults_of(browser, page):
                bad += 1
                print(f"{page.relative_to(BUILT)}: {fault}")
        for name in given.names if given.pictures else ():
            given.pictures.mkdir(parents=True, exist_ok=True)
            browser.open((BUILT / f"{name}.html").as_uri())
            for width in WIDTHS:
                for dark in (False, True):
                    target = given.pictures / f"{name.replace('/', '-')}-{width}{'-dark' * dark}.png"
                    browser.picture(target, width, dark)
        hits = hits_of(browser, "preload")  # last, because found words stay marked
        print(f"search for 'preload': {hits} pages")
    sys.exit(bool(bad) or not hits)


if __name__ == "__main__":
    main()
