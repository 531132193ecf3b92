"""Large maps are interpolated stripe by stripe, as small ones are as a whole."""

import numpy as np
import pytest

from pgfmd.maps import raw
from pgfmd.maps.raw import MapKeys
from pgfmd.physics import heightfile
from pgfmd.physics.heightfile import EDGE, HeightMap, MapRequest, height_map


@pytest.mark.parametrize("shape", [(101, 67), (3, 500), (500, 3)])
@pytest.mark.parametrize("order", heightfile.ORDERS)
@pytest.mark.parametrize("periodic", [True, False])
def test_stripes_give_the_heights_of_the_whole_map(periodic, order, shape, monkeypatch):
    random = np.random.default_rng(3)
    heights = random.normal(size=shape)
    # Beyond the edges too: there a map goes on, by itself or by its edge.
    x, y = random.uniform(-0.7, 0.7, (2, 4000))
    whole = HeightMap(heights, (1.0, 1.0), periodic, order)(x, y, radius=0.4)
    monkeypatch.setattr(raw, "WHOLE", 700)
    striped = HeightMap(heights, (1.0, 1.0), periodic, order)
    # The whole map's spline knows of no more than a few samples beyond the edge.
    exact = periodic or order == 1
    np.testing.assert_allclose(striped(x, y, radius=0.4), whole, atol=1e-12 if exact else 2.0 * 0.27**EDGE)
    # A place has the same bits whatever others are asked for along with it.
    some = slice(100, 200)
    np.testing.assert_array_equal(striped(x[some], y[some], radius=0.4), striped(x, y, radius=0.4)[some])


def test_a_large_map_on_the_disk_is_not_taken_into_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(raw, "WHOLE", 100)
    heights = np.random.default_rng(4).integers(-9, 9, (40, 50)).astype(np.int16)
    np.save(tmp_path / "map.npy", heights)

    def read(**keys):
        return height_map(MapRequest(str(tmp_path / "map.npy"), MapKeys((1.0, 1.0), **keys), None, False, 1))

    found = read()
    assert isinstance(found.heights, np.memmap) and found.on_disk
    x, y = np.meshgrid((np.arange(50) + 0.5) / 50 - 0.5, (np.arange(40) + 0.5) / 40 - 0.5)
    np.testing.assert_allclose(found(x, y), heights, atol=1e-11)
    # Nor is one whose heights are made anew from its numbers, a stripe at a time.
    level = read(unit="mm", peaks="up", detrend="tilt")
    assert level.on_disk and level.heights[3:5].shape == (2, 50)
    flat = np.stack([np.ones_like(x), x, y]).reshape(3, -1)
    rest = -1e-3 * heights.ravel() - flat.T @ np.linalg.lstsq(flat.T, -1e-3 * heights.ravel())[0]
    np.testing.assert_allclose(level(x, y).ravel(), rest, atol=1e-4 * 1e-3)
