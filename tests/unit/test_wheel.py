"""The package as it is built: what a user without the checkout gets."""

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

from pgfmd.scene import shipped_scenes

ROOT = Path(__file__).parents[2]


def test_a_wheel_has_the_scenes_and_nothing_of_the_checkout(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)],
        cwd=ROOT, check=True, capture_output=True, timeout=100,
    )  # fmt: skip
    (wheel,) = tmp_path.glob("pgfmd-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (metadata,) = (archive.read(name).decode() for name in names if name.endswith("METADATA"))
        (entries,) = (archive.read(name).decode() for name in names if name.endswith("entry_points.txt"))
    tops = {name.partition("/")[0] for name in names}
    assert tops == {"pgfmd", next(top for top in tops if top.endswith(".dist-info"))}
    assert {f"pgfmd/scenes/{name}.toml" for name in shipped_scenes()} <= set(names)
    assert "pgfmd/py.typed" in names
    assert not [name for name in names if name.endswith((".nbi", ".nbc", ".pyc"))]
    assert "pgfmd = pgfmd.cli:main" in entries
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for extra in ("formats", "movie", "notebook", "pandas", "report"):
        assert extra in extras
        assert f"Provides-Extra: {extra}" in metadata
