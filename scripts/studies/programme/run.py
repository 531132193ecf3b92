"""Makes docs/figures/programme_*.csv, programme_stiffness.png and the tables of docs/evidence/programme.md.

python -m scripts.studies.programme.run                     everything; twenty minutes on one core
python -m scripts.studies.programme.run --stiffness         oscillations of a flat punch alone
python -m scripts.studies.programme.run --stress            programmes far and wide alone
python -m scripts.studies.programme.run --stress --scene gfmd   of scenes with this in their name; nothing is written
"""

from __future__ import annotations

import argparse
import sys

from pgfmd.host import launch

from ..pages import fill, page_named
from . import stiffness, stress


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stiffness", action="store_true", help="only the oscillations of a flat punch")
    parser.add_argument("--stress", action="store_true", help="only the programmes far and wide")
    parser.add_argument("--scene", default="", help="of these only scenes with this in their name; writes nothing")
    options = parser.parse_args()
    launch.world()
    failed, page = 0, page_named("programme.md")
    if options.stiffness or not options.stress:
        rows = stiffness.measure()
        stiffness.save(rows)
        stiffness.draw(rows)
        fill(page, "stiffness", lambda _: stiffness.table(rows))
    if options.stress or not options.stiffness:
        results = stress.measure(options.scene)
        failed = sum(one.verdict == "FAILED" for one in results)
        print(f"{len(results)} cases, {failed} failed")
        if not options.scene:
            stress.save(results)
            fill(page, "stress", lambda _: stress.table(results))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
