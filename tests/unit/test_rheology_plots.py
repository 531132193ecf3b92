"""From a DMA file to a scene's table and pictures: what is written loads again, what is drawn is what was computed."""

import re
import sys
import tomllib
import warnings

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from pgfmd.characterisation.rheology_table import characterise, wlf_constants
from pgfmd.characterisation.temperature_shift import WLF
from pgfmd.errors import MeasurementError, ResultError
from pgfmd.parts import series_of
from pgfmd.physics.rheology import PronySeries
from pgfmd.plots import rheology as rheology_plots
from pgfmd.plots.drawing import write_picture
from pgfmd.reference.prony import gfmd_creep
from pgfmd.scene import scene_from_mapping, shipped_text

FIVE = PronySeries.geometric(250, 40e-6, elements=5, time_ratio=6, exponent=0.8)
TWENTY = PronySeries.geometric(1000, 1e-7, elements=20, time_ratio=3, exponent=0.5)
KNOWN = WLF(8.86, 101.6, 298.15)


@pytest.fixture(autouse=True)
def warnings_are_errors():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def settings():
    return matplotlib.rcParams.copy(), matplotlib.get_backend(auto_select=False), "matplotlib.pyplot" in sys.modules


def one_temperature(path, series=FIVE, noise=0.02, celsius=None):
    random = np.random.default_rng(4)
    omega = np.geomspace(0.1, 1e6, 50)
    factors = 1 + noise * random.standard_normal((2, omega.size))
    storage, loss = 2 * factors * [series.storage(omega), series.loss(omega)]
    extra = "" if celsius is None else f",{celsius}"
    rows = [f"{w},{e},{v}{extra}" for w, e, v in zip(omega, storage, loss, strict=True)]
    path.write_text("\n".join(["omega (rad/s),E' (MPa),E'' (MPa)" + (extra and ",T (C)"), *rows]))
    return path


def several_temperatures(path, noise=0.02, vertical=False):
    random = np.random.default_rng(7)
    rows = ["T (C),frequency (Hz),E' (MPa),E'' (MPa)"]
    for celsius in range(-15, 46, 10):
        frequency = np.geomspace(0.1, 100, 16)
        omega = 2 * np.pi * frequency * 10 ** KNOWN.log_shift(celsius + 273.15)
        b = (celsius + 273.15) / 298.15 if vertical else 1.0
        moduli = 2 * b * (1 + noise * random.standard_normal((2, 16))) * [TWENTY.storage(omega), TWENTY.loss(omega)]
        rows += [f"{celsius},{f},{e},{v}" for f, e, v in zip(frequency, *moduli, strict=True)]
    path.write_text("\n".join(rows))
    return path


def scene_with(table):
    """tri-tack with the [rheology] of a table, and the modulus that the table asks for."""
    mapping = tomllib.loads(shipped_text("tri-tack"))
    mapping["rheology"] = tomllib.loads(table)["rheology"]
    mapping["substrate"]["youngs_modulus"] = re.search(r'# youngs_modulus = "(.*)"', table)[1]
    return scene_from_mapping(mapping)


@pytest.mark.parametrize("elements", [None, 12])
def test_the_table_loads_in_a_scene_and_is_the_measured_material(tmp_path, elements):
    material = characterise(several_temperatures(tmp_path / "dma.csv"), elements, 298.15)
    scene = scene_with(material.table())
    series, omega = series_of(scene.rheology), np.geomspace(0.1, 1e7, 50)
    assert scene.substrate.youngs_modulus == pytest.approx(2e6, rel=0.02)
    np.testing.assert_allclose(series.storage(omega), material.fit.series.storage(omega), rtol=1e-4)
    np.testing.assert_allclose(series.storage(omega), TWENTY.storage(omega), rtol=0.12)
    np.testing.assert_allclose(series.loss(omega), TWENTY.loss(omega), rtol=0.2)


def test_the_report_names_constants_shifts_range_and_misfit(tmp_path):
    material = characterise(several_temperatures(tmp_path / "dma.csv", noise=0.0), None, 298.15)
    report = list(material.report())
    assert report[0] == "dma.csv: 112 points from 7 sweeps at -15 C to 45 C"
    constants = re.fullmatch(r"WLF, fitted: C1 = (\S+), C2 = (\S+) K at 25 C", report[1])
    assert [float(value) for value in constants.groups()] == pytest.approx([8.86, 101.6], rel=1e-3)
    assert report[6] == "  25 C: a_T = 1"
    factor = float(report[2].removeprefix("  -15 C: a_T = "))
    assert np.log10(factor) == pytest.approx(8.86 * 40 / 61.6, abs=1e-3)
    assert report[9].startswith("master curve: 0.0219 to 3.") and report[9].endswith("rad/s, 10.2 decades")
    misfit = re.fullmatch(r"fit of \d+ elements: misfit (\S+) % rms, largest (\S+) % \(E'+ at \S+ rad/s\)", report[10])
    assert float(misfit[1]) == pytest.approx(100 * material.fit.rms, rel=0.05)
    assert float(misfit[2]) == pytest.approx(100 * np.abs(material.fit.misfit).max(), rel=0.05)
    assert all(f"# {line}\n" in material.table() for line in report)


def test_given_constants_and_vertical_shift(tmp_path):
    path = several_temperatures(tmp_path / "dma.csv", noise=0.0, vertical=True)
    material = characterise(path, None, 298.15, (8.86, 101.6), vertical=True)
    assert material.wlf == KNOWN and material.fit.rms < 0.01
    assert "WLF, given: C1 = 8.86, C2 = 101.6 K at 25 C" in material.table()
    line = next(line for line in material.report() if line.startswith("  45 C"))
    shift, factor = re.fullmatch(r"  45 C: a_T = (\S+), b_T = (\S+)", line).groups()
    assert float(shift) == pytest.approx(10 ** (-8.86 * 20 / 121.6), rel=1e-3)
    assert float(factor) == pytest.approx(318.15 / 298.15, rel=1e-4)
    assert material.fit.static_modulus == pytest.approx(2e6, rel=0.01)
    # A single sweep can be moved with given constants, by the same factor in all times.
    still = characterise(one_temperature(tmp_path / "one.csv", noise=0.0, celsius=25))
    moved = characterise(tmp_path / "one.csv", 5, 288.15, (8.86, 101.6))
    factor = 10 ** float(WLF(8.86, 101.6, 288.15).log_shift(298.15))
    np.testing.assert_allclose(moved.fit.series.tau * factor, still.fit.series.tau, rtol=1e-4)


def test_elastic_data_make_an_elastic_scene(tmp_path):
    path = tmp_path / "dma.csv"
    path.write_text("omega,E' (MPa),E'' (MPa)\n1,3,0\n10,3,0\n100,3,0\n")
    scene = scene_with(characterise(path).table())
    assert scene.rheology.model == "elastic" and scene.substrate.youngs_modulus == 3e6


def test_what_can_not_be_a_scene_is_refused(tmp_path):
    steep = PronySeries.geometric(1e8, 1e-6, elements=12, time_ratio=8, exponent=0.9)
    omega = np.geomspace(1e-6, 1e8, 150)
    rows = [f"{w},{e},{v}" for w, e, v in zip(omega, steep.storage(omega), steep.loss(omega), strict=True)]
    (tmp_path / "steep.csv").write_text("\n".join(["omega,E' (kPa),E'' (kPa)", *rows]))
    with pytest.raises(MeasurementError, match=r"a scene takes at most 1e\+06; leave out the highest"):
        characterise(tmp_path / "steep.csv")


def test_temperatures_that_are_missing_are_asked_for(tmp_path):
    one, several = one_temperature(tmp_path / "one.csv"), several_temperatures(tmp_path / "several.csv")
    with pytest.raises(MeasurementError, match=r"several\.csv: expected --reference-temperature.*-15 C, -5 C, 5 C"):
        characterise(several)
    with pytest.raises(MeasurementError, match=r"expected temperatures for a shift.*add a column"):
        characterise(one, reference_temperature=298.15)
    with_temperature = one_temperature(tmp_path / "t.csv", celsius=23)
    assert characterise(with_temperature, reference_temperature=296.5).wlf is None
    with pytest.raises(MeasurementError, match="one sweep at 23 C can't be shifted to 40 C without constants"):
        characterise(with_temperature, reference_temperature=313.15)
    with pytest.raises(MeasurementError, match=r"several\.csv: the WLF equation with C2 = 30 K ends at"):
        characterise(several, None, 298.15, (8.0, 30.0))
    (tmp_path / "short.csv").write_text("omega,E' (MPa),E'' (MPa)\n1,3,0\n10,3,0\n")
    with pytest.raises(MeasurementError, match=r"short\.csv: expected at least 3 frequencies, found 2"):
        characterise(tmp_path / "short.csv")


def test_a_reference_outside_the_measurement_is_warned_about(tmp_path):
    path = several_temperatures(tmp_path / "dma.csv")
    assert "80 C lies outside the measured ones" in characterise(path, None, 353.15).warnings()[-1]
    assert characterise(path, None, 298.15).warnings() == []


def test_wlf_constants_as_an_option():
    assert wlf_constants("8.86, 101.6") == (8.86, 101.6)
    for text in ("8.86", "8.86,x", "8.86;101.6", "-1,2", "1,nan", "1,2,3"):
        with pytest.raises(ValueError, match="expected two positive numbers"):
            wlf_constants(text)


def test_modulus_is_drawn_with_every_element_and_both_guides():
    axis = Figure().subplots()
    rheology_plots.draw_modulus(axis, FIVE)
    lines = axis.get_lines()
    omega, storage = lines[0].get_data()
    np.testing.assert_array_equal(storage, FIVE.storage(omega))
    np.testing.assert_array_equal(lines[1].get_ydata(), FIVE.loss(omega))
    np.testing.assert_allclose(1 + sum(line.get_ydata() for line in lines[2:7]), storage, rtol=1e-14)
    assert all(line.get_linestyle() == ":" for line in lines[2:7]) and len(lines) == 9
    for line, exponent in zip(lines[7:], (0.8, 0.5), strict=True):
        x, y = line.get_data()
        np.testing.assert_allclose(np.diff(np.log(y)) / np.diff(np.log(x)), exponent, rtol=1e-9)
        at = np.exp(np.interp(np.log(np.sqrt(250)), np.log(y), np.log(x)))
        assert float(FIVE.storage(at)) == pytest.approx(np.sqrt(250), rel=1e-3)


def test_creep_is_drawn_for_target_and_implemented_models():
    axis = Figure().subplots()
    rheology_plots.draw_creep(axis, FIVE)
    target, *others = [line for line in axis.get_lines() if len(line.get_xdata()) > 2]
    np.testing.assert_array_equal(target.get_ydata(), FIVE.creep(target.get_xdata()))
    assert target.get_color() == "black" and target.get_linestyle() == "-"
    for line, phase in zip(others, (1, 2, 4, 8), strict=True):
        expected = gfmd_creep(line.get_xdata(), FIVE, phase * np.pi / 40e-6)
        np.testing.assert_array_equal(line.get_ydata(), expected)
        assert line.get_linestyle() == "--"
    assert [text.get_text() for text in axis.get_legend().get_texts()][2] == (
        r"$\omega_\mathrm{GFMD}\,\tau_\mathrm{min} = 2\pi$"
    )


@pytest.mark.parametrize(
    "series",
    [
        PronySeries.single(250, 4e-4),
        FIVE,
        PronySeries(np.full(40, 25e3), np.logspace(6, -6, 40)),
        PronySeries([1e-3], [1]),
    ],
)
def test_rheology_picture(tmp_path, series):
    rheology_plots.plot_rheology(series, "a title").savefig(tmp_path / "r.png")
    picture = imread(tmp_path / "r.png")
    assert picture.shape[0] > 500 and picture.shape[1] > 1200 and picture[..., :3].std() > 0.03


def test_elastic_and_unwritable_pictures_are_refused(tmp_path):
    with pytest.raises(ValueError, match="there is nothing to draw"):
        rheology_plots.plot_rheology(PronySeries.elastic())
    for name in ("no/folder.png", "r.nonsense"):
        with pytest.raises(ResultError, match="could not be written"):
            write_picture(rheology_plots.plot_rheology(FIVE), tmp_path / name)


def test_fit_picture_shows_every_point_at_its_shifted_place(tmp_path):
    material = characterise(several_temperatures(tmp_path / "dma.csv", vertical=True), None, 298.15, vertical=True)
    upper, lower = rheology_plots.plot_fit(material).axes
    drawn = [line for line in upper.get_lines() if line.get_linestyle() == "None"]
    for marker, values in (("o", material.fit.storage), ("s", material.fit.loss)):
        points = np.concatenate([line.get_xydata() for line in drawn if line.get_marker() == marker])
        points = points[np.argsort(points[:, 0], kind="stable")]
        np.testing.assert_allclose(points, np.stack([material.fit.omega, values / 1e6], axis=1), rtol=1e-12)
    np.testing.assert_array_equal(lower.get_lines()[1].get_ydata(), 100 * material.fit.misfit[0])
    assert "\N{MINUS SIGN}15 °C" in [text.get_text() for text in upper.get_legend().get_texts()]


@pytest.mark.parametrize("make", [one_temperature, several_temperatures])
def test_fit_picture_is_written(tmp_path, make):
    before = settings()
    material = characterise(make(tmp_path / "dma.csv"), 8, 298.15 if make is several_temperatures else None)
    rheology_plots.plot_fit(material).savefig(tmp_path / "fit.png")
    assert imread(tmp_path / "fit.png")[..., :3].std() > 0.03
    rheology_plots.plot_rheology(material.fit.series).savefig(tmp_path / "rheology.png")
    assert settings() == before
