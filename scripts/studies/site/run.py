"""Makes the pictures of docs/gallery.md and of the first page, by the commands that the gallery shows.

python -m scripts.studies.site.run                 # 5 minutes on one core; runs are kept in out/site
python -m scripts.studies.site.run cycles fit      # these alone
python -m scripts.studies.site.run --text          # captions and commands alone
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys

from PIL import Image

from scripts.studies.pages import DOCS, FIGURES, ROOT, fill
from scripts.studies.site.entries import ENTRIES, Entry

OUT, PICTURES, MOVIE = ROOT / "out" / "site", FIGURES / "site", DOCS / "static" / "tack.mp4"
PAGE = DOCS / "gallery.md"
COLOURS, WIDTH, LARGEST, LARGEST_MOVIE = 256, 1000, 200_000, 1_000_000
"""Of the pictures: colours of those that are too large with all, width [pixels], size [bytes]; of the movie: size [bytes]."""

NUMBER = "n\u00a0=\u00a0"
"""What a caption says before n, without a break of the line."""


def shell_lines(entry: Entry) -> str:
    """The commands, and the files that they read, as one writes them into a shell."""
    files = [f"cat > {name} <<'END'\n{text}END" for name, text in entry.text]
    return "\n".join([*files, *entry.commands])


def block(name: str) -> str:
    """An entry of the page: picture, caption, scene, commands."""
    entry = ENTRIES[name]
    picture = f"[![{entry.title}](figures/site/{name}.png)](reference/shipped_scenes.md#{entry.scene})"
    caption = (
        f"{entry.caption.replace('n = ', NUMBER)} Scene: [{entry.scene}](reference/shipped_scenes.md#{entry.scene})."
    )
    return f"## {entry.title}\n\n{picture}\n\n{caption}\n\n```bash\n{shell_lines(entry)}\n```"


def thumbnails(_name: str) -> str:
    """All pictures, small; each leads to its entry."""
    links = (
        f"[![{entry.title}](figures/site/{name}.png)](#{entry.title.lower().replace(' ', '-')})"
        for name, entry in ENTRIES.items()
    )
    return "\n".join((":::{container} thumbnails", *links, ":::"))


def make(name: str) -> None:
    """Does the commands of an entry in OUT, and keeps its picture. SystemExit if one fails."""
    entry = ENTRIES[name]
    for file, text in entry.text:
        (OUT / file).write_text(text, encoding="utf-8")
    for command in entry.commands:
        print(f"{name}: {command}", file=sys.stderr, flush=True)
        done = subprocess.run(["bash", "-c", command], cwd=OUT, stdout=subprocess.DEVNULL)
        if done.returncode:
            raise SystemExit(f"{name}: {command}: exit code {done.returncode}")
    picture = Image.open(OUT / entry.made).convert("RGB")
    picture.thumbnail((WIDTH, 2 * WIDTH), Image.Resampling.LANCZOS)
    target = PICTURES / f"{name}.png"
    picture.save(target, optimize=True)
    if target.stat().st_size > LARGEST:
        picture.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)
    limited(target, LARGEST)
    if name == "movie":
        shutil.copyfile(OUT / "tack.mp4", MOVIE)
        limited(MOVIE, LARGEST_MOVIE)


def limited(path, largest: int) -> None:
    """SystemExit if a file is too large for the site."""
    if (size := path.stat().st_size) > largest:
        raise SystemExit(f"{path}: {size} bytes: expected at most {largest}; fewer colours or frames make it smaller")


def main() -> None:
    """Makes all pictures, or those that are named, and fills the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(ENTRIES)}; all by default")
    options.add_argument("--text", action="store_true", help="only captions and commands of the page")
    given = options.parse_args()
    if wrong := set(given.names) - set(ENTRIES):
        options.error(f"{', '.join(sorted(wrong))}: expected some of {', '.join(ENTRIES)}")
    for folder in (OUT, PICTURES, MOVIE.parent):
        folder.mkdir(parents=True, exist_ok=True)
    for name in () if given.text else given.names or ENTRIES:
        make(name)
    fill(PAGE, "thumbnails", thumbnails)
    fill(PAGE, "gallery", block)


if __name__ == "__main__":
    main()
