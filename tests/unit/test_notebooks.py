"""The notebooks of the tutorials, executed at a small size."""

from pathlib import Path

import pytest

TUTORIALS = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
SMALL = {
    "first_test": "n = 32",
    "data_to_overlay": "points = 32",
    "rates_and_preloads": 'n = 24\nspeeds = ["50 um/s", "250 um/s"]\npreloads = ["2 mN"]',
}
"""What the cell tagged `parameters` is replaced by."""


def test_there_is_a_small_size_of_each():
    assert {path.stem for path in TUTORIALS.glob("*.ipynb")} == set(SMALL)


@pytest.mark.timeout(200)
@pytest.mark.parametrize("name", SMALL)
def test_a_notebook_runs_from_its_first_cell_to_its_last(name):
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    from scripts.studies.notebooks.run import execute

    book = execute(TUTORIALS / f"{name}.ipynb", SMALL[name])
    outputs = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not any(output.get("name") == "stderr" for output in outputs)
    assert any(cell.outputs for cell in book.cells if cell.cell_type == "code")
