"""`pgfmd analyse` and `pgfmd compare`: files, tables, pictures, refusals."""

import json
import re

import numpy as np
import pytest
from matplotlib.image import imread
from typer.testing import CliRunner

from pgfmd.analysis import pictures
from pgfmd.analysis.bulges import bulges
from pgfmd.analysis.hysteresis import Audit, Twin
from pgfmd.analysis.summary import analyse
from pgfmd.cli import app
from pgfmd.errors import ResultError
from pgfmd.scene import shipped_text
from tests.unit.analysis_loops import flat_punch_loop, loop_of, triangle, write_folder
from tests.unit.small_runs import run


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """A viscous run and, on the same coarse grid, its elastic twin."""
    folder = tmp_path_factory.mktemp("runs")
    return run(folder / "viscous"), run(folder / "elastic", "rheology.model=elastic")


def pgfmd(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_analyse_writes_record_and_pictures(real):
    viscous, elastic = real
    done = pgfmd("analyse", viscous, "--twin", elastic, "--bearing-area", "--low-pass", "0.1um")
    assert done.exit_code == 0, done.exception
    names = {path.name for path in viscous.glob("analysis*")}
    assert names >= {"analysis.json", "analysis-compliance.png", "analysis-hysteresis.png", "analysis-twin.png",
                     "analysis-bearing-area.png"}  # fmt: skip
    assert all(str(viscous / name) in done.stdout.replace("\n", "") for name in names)
    record = json.loads((viscous / "analysis.json").read_text())
    own = json.loads((viscous / "run.json").read_text())
    assert record["forces"]["low_pass_m"] == pytest.approx(1e-7)
    assert record["forces"]["pull_off_force_N"] == pytest.approx(own["pull_off_force_N"], rel=0.05)
    against = record["hysteresis_against_the_quasi_static_twin"]
    assert against["multistability_share"] + against["viscous_and_coaction_share"] == pytest.approx(1.0)
    audit = record["hysteresis_by_the_energy_audit"]
    parts = sum(audit[f"audit_{part}_J"] for part in ("viscous", "released", "stored", "residual"))
    assert audit["audit_work_J"] == pytest.approx(parts, rel=1e-9)
    assert record["effective_tabor_number"]["effective_tabor_number"] > 0
    assert record["bearing_area_model"]["summits"] == 23
    for name in names - {"analysis.json"}:
        picture = imread(viscous / name)
        assert picture.shape[0] > 300 and picture[..., :3].std() > 0.02


def test_analyse_prints_json(real):
    done = pgfmd("analyse", real[1], "--json")
    assert json.loads(done.stdout) == json.loads((real[1] / "analysis.json").read_text())


def test_analyse_refuses_with_one_message(tmp_path, real):
    assert "no such folder" in str(pgfmd("analyse", tmp_path / "nothing").exception)
    assert pgfmd("analyse", real[0], "--low-pass", "0.1").exit_code == 2
    assert pgfmd("analyse", real[0], "--low-pass", "-1 um").exit_code == 2
    refused = pgfmd("analyse", real[0], "--asperity", real[1])
    assert "expected the run of one asperity, punch.pattern = sphere, found triangular" in str(refused.exception)
    folder = write_folder(tmp_path / "flat", flat_punch_loop(), shipped_text("flat-punch"))
    with pytest.raises(ResultError, match="no bearing-area model: the face has no summits"):
        analyse(folder, bearing_area=True)


def test_a_run_that_has_just_begun_is_analysed_as_far_as_it_goes(tmp_path):
    scene = '[punch]\nradius = "375 um"\n'
    folder = write_folder(tmp_path / "young", loop_of([1e-7, -1e-6], [0.0, 1e-3], 2), scene)
    (folder / "energy.csv").unlink()
    (folder / "run.json").unlink()
    analysis = analyse(folder)
    assert analysis.record["forces"]["pull_off_force_N"] is None
    assert analysis.write() == [folder / "analysis.json"]


def measured(path, loop, stiffness):
    """A measurement of a loop with a machine of this stiffness [N/m]."""
    rows = zip((1e6 * (loop.indentation + loop.force / stiffness)).tolist(), (1e3 * loop.force).tolist(), strict=True)
    path.write_text("displacement (um),force (mN)\n" + "".join(f"{x!r},{f!r}\n" for x, f in rows))
    return path


def value(text, name):
    """The number of a row of a printed table."""
    return float(re.search(rf"^{name} +(\S+)", text, re.MULTILINE)[1])


def test_compare_lays_a_measurement_over_a_run(tmp_path):
    loop = flat_punch_loop()
    folder = write_folder(tmp_path / "run", loop, "")
    exp = measured(tmp_path / "exp.csv", loop, 38.1e3)
    done = pgfmd("compare", folder, exp, "--machine-stiffness", "38.1kN/m", "--out", tmp_path / "both.png")
    assert done.exit_code == 0, done.exception
    assert imread(tmp_path / "both.png").shape[1] > 500
    assert value(done.stdout, "machine stiffness, k_M") == 38100
    assert re.search(r"^exp +- F/k_M \(38.1 kN/m\) *$", done.stdout, re.MULTILINE)
    assert value(done.stdout, "difference of forces") < 1e-9
    off = pgfmd("compare", folder, exp, "--out", tmp_path / "both.png")
    assert re.search(r"^run +as simulated *\nexp +as measured *$", off.stdout, re.MULTILINE)
    assert "machine" not in off.stdout and value(off.stdout, "difference of forces") > 1e-4


def test_compare_of_folders_alone_and_its_refusals(tmp_path):
    loop = flat_punch_loop()
    one, two = (write_folder(tmp_path / name / "run", loop, "") for name in ("a", "b"))
    done = pgfmd("compare", one, two, "-o", tmp_path / "runs.png")
    assert done.exit_code == 0 and "Curve 2, run (2)" in done.stdout and "machine" not in done.stdout
    exp = measured(tmp_path / "exp.csv", loop, 1e9)
    assert "at least one folder" in str(pgfmd("compare", exp).exception)
    assert pgfmd("compare", one, exp, "--machine-stiffness", "38.1").exit_code == 2
    assert pgfmd("compare", one, exp, "--machine-stiffness", "0 kN/m").exit_code == 2
    assert pgfmd("compare", one, exp, "--correct", "both").exit_code == 2
    lost = pgfmd("compare", one, exp, "--out", tmp_path / "missing" / "x.png")
    assert "x.png: could not be written" in str(lost.exception)


def test_figures_show_the_right_data():
    displacement, turn = triangle(10e-6, 4e-6)
    loop = loop_of(displacement, -1e3 * displacement, turn)
    axis = pictures.overlay_figure([loop, loop.pushed_in_by(1e-6)], 1).axes[0]
    first = next(line for line in axis.lines if line.get_label() == "made")
    np.testing.assert_allclose(first.get_xdata()[-1], -4.0)
    np.testing.assert_allclose(first.get_ydata()[0], 10.0)
    bars = pictures.hysteresis_figure(Audit(10e-9, 6e-9, 3e-9, 0.5e-9, 0.5e-9), Twin("t", 10e-9, 4e-9, ())).axes[0]
    assert [bar.get_height() for bar in bars.patches] == pytest.approx([6, 3, 1, 4, 6])
    dip = loop.with_force(loop.force - 2e-3 * np.exp(-0.5 * ((displacement + 5e-6) / 0.4e-6) ** 2))
    found = bulges(dip)
    marks = pictures.bulge_figure(dip, found).axes[0].lines[-1]
    assert found and marks.get_xdata()[0] == pytest.approx(-1e6 * found[0].displacement)
