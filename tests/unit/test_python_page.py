"""The programs of the pages about Python do what they say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = {"tutorials/python.md": "strongest", "reference/python.md": "Largest"}
"""Pages, and a word of a program of theirs."""


@pytest.mark.parametrize("page", PAGES)
def test_the_programs_of_a_page_run_one_after_the_other(page, tmp_path):
    blocks = re.findall(r"^```python\n(.*?)^```", (DOCS / page).read_text(encoding="utf-8"), re.S | re.M)
    assert any(PAGES[page] in block for block in blocks)
    program = tmp_path / "page.py"
    # On coarser grids: their numbers are not asked for.
    text = re.sub(r'"n": (\d+)', lambda match: f'"n": {int(match[1]) // 2}', "\n".join(blocks))
    program.write_text(text, encoding="utf-8")
    done = subprocess.run([sys.executable, "page.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
