"""The figures of docs/evidence/paper.md: one study per figure of the paper, and what goes beyond it.

`<study>.toml` are studies as `pgfmd study` takes them; the first word of a case's name is its size. `pool` finds the
runs that several studies share, `registry` tells which figure needs which studies, the other modules draw.
"""

from pathlib import Path

HERE = Path(__file__).resolve().parent
