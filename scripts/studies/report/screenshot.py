"""Makes docs/figures/report.png, the first part of a report of a run and its twin, as Chromium shows it.

python -m scripts.studies.report.screenshot                  # runs both in out/report first: some minutes
python -m scripts.studies.report.screenshot --look pages     # the pages whole, at 400 and 1400 px, dark, and on paper
"""

from __future__ import annotations

import argparse
import io
import tempfile
from pathlib import Path

from PIL import Image

import pgfmd
from tests.unit.chromium import Browser, executable

ROOT = Path(__file__).resolve().parents[3]
OUT, PICTURE = ROOT / "out" / "report", ROOT / "docs" / "figures" / "report.png"
WIDTH, HEIGHT = 1000, 1180
SCENE = {
    "grid": {"n": 176},
    "drive": {"preload": "10 mN"},
    "output": {"snapshots": ["0.25 t_pl", "0.5 t_pl", "0.75 t_pl", "1.25 t_pl", "1.5 t_pl", "1.75 t_pl"]},
}
TWIN = {**SCENE, "solver": {"scheme": "quasistatic"}}


def main() -> None:
    """Runs, reports, and looks."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--look", type=Path, metavar="DIR", help="write pictures of the whole page into DIR as well")
    look = options.parse_args().look
    if executable() is None:
        raise SystemExit("no Chromium on PATH")
    for name, keys in (("tack", SCENE), ("twin", TWIN)):
        pgfmd.run(pgfmd.Scene("tri-tack", **keys), OUT / name)
    page = pgfmd.report(OUT / "tack", twin=OUT / "twin")
    with tempfile.TemporaryDirectory() as folder, Browser(Path(folder)) as browser:
        browser.open(page.as_uri())
        browser.run("document.getElementById('slider').value = 3")
        browser.run("document.getElementById('slider').dispatchEvent(new Event('input'))")
        whole = Path(folder) / "page.png"
        browser.picture(whole, WIDTH)
        shown = Image.open(io.BytesIO(whole.read_bytes())).crop((0, 0, WIDTH, HEIGHT))
        shown.quantize(64).save(PICTURE, optimize=True)
        if look:
            look.mkdir(parents=True, exist_ok=True)
            for width in (400, 1400):
                browser.picture(look / f"{width}.png", width)
                browser.picture(look / f"{width}-dark.png", width, dark=True)
            browser.paper(look / "page.pdf")
        if browser.faults:
            raise SystemExit(f"the page has faults: {browser.faults}")
    print(PICTURE)


if __name__ == "__main__":
    main()
