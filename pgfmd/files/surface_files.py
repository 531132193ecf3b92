"""Formats in which surfaces leave pgfmd: triangles as STL, height maps as npy, npz, xyz, x3p and netCDF. All to bytes.

A height map is z[iy, ix], lengths in m; NaN where there is no height. Its first row has the smallest y, its first column the
smallest x, and samples sit in the middle of their pixels.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_X3P_NAMESPACE = "http://www.opengps.eu/2008/ISO5436_2"


@dataclass(frozen=True, eq=False)
class HeightMapFile:
    """What a file of a height map says. z [m]: (rows, columns). pixel [m]: along x and y. first [m]: x and y of the first sample.
    title: a line about it. periodic: whether it goes on from its last row and column to its first. peaks: "down" if the lower
    places touch first, or "up"; said in the files that have a place for it."""

    z: Array
    pixel: tuple[float, float]
    first: tuple[float, float]
    title: str
    periodic: bool = False
    peaks: str = "down"

    @property
    def size(self) -> tuple[float, float]:
        """Lengths [m] along x and y, whole pixels."""
        rows, columns = self.z.shape
        return columns * self.pixel[0], rows * self.pixel[1]


def stl_bytes(corners: Array, title: str) -> bytes:
    """Triangles as a binary STL file, in mm, as programs that print take it. corners [m]: (triangles, corner, axis), in the
    mathematical sense as seen from outside."""
    records = np.zeros(len(corners), _TRIANGLE)
    records["corners"] = 1e3 * corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    # A file whose header begins with "solid" is taken for a text.
    header = f"pgfmd, mm: {title}".encode("ascii", "replace")[:80].ljust(80)
    return header + len(corners).to_bytes(4, "little") + records.tobytes()


def npy_bytes(surface: HeightMapFile) -> bytes:
    """The array alone: no size, no unit."""
    file = io.BytesIO()
    np.save(file, surface.z, allow_pickle=False)
    return file.getvalue()


def npz_bytes(surface: HeightMapFile) -> bytes:
    """The arrays "z" and "size" (x, y) [m], and the words "unit" and "peaks"."""
    file = io.BytesIO()
    np.savez(file, z=surface.z, size=np.array(surface.size), unit=np.array("m"), peaks=np.array(surface.peaks))
    return file.getvalue()


def xyz_bytes(surface: HeightMapFile) -> bytes:
    """A table of x, y and z [m] for each sample that has a height, row by row; names and units in its first line."""
    rows, columns = surface.z.shape
    x = surface.first[0] + surface.pixel[0] * np.arange(columns)
    y = surface.first[1] + surface.pixel[1] * np.arange(rows)
    table = np.column_stack([np.tile(x, rows), np.repeat(y, columns), surface.z.ravel()])
    file = io.BytesIO()
    known, formats = np.isfinite(table[:, 2]), ("%.15g", "%.15g", "%.17g")
    np.savetxt(file, table[known], formats, delimiter="\t", header="x (m)\ty (m)\tz (m)", comments="")
    return file.getvalue()


def x3p_bytes(surface: HeightMapFile) -> bytes:
    """An archive after ISO 25178-72 (ISO 5436-2): a description in XML, the heights as numbers of double precision, and MD5 sums of
    both. Samples without a height are NaN."""
    data = np.ascontiguousarray(surface.z, "<f8").tobytes()
    main = _x3p_description(surface, hashlib.md5(data, usedforsecurity=False).hexdigest().upper()).encode()
    checksum = f"{hashlib.md5(main, usedforsecurity=False).hexdigest().upper()} *main.xml\n"
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (("main.xml", main), ("bindata/data.bin", data), ("md5checksum.hex", checksum.encode())):
            archive.writestr(name, content)
    return file.getvalue()


def _x3p_description(surface: HeightMapFile, checksum: str) -> str:
    """The file main.xml: records 1 (axes), 2 (origin), 3 (the matrix) and 4 (checksum)."""
    rows, columns = surface.z.shape
    axes = {
        "CX": ("I", surface.pixel[0], surface.first[0]), "CY": ("I", surface.pixel[1], surface.first[1]), "CZ": ("A", 1.0, 0.0),
    }  # fmt: skip
    axis_records = "".join(
        f"      <{name}><AxisType>{kind}</AxisType><DataType>D</DataType><Increment>{step!r}</Increment>"
        f"<Offset>{offset!r}</Offset></{name}>\n"
        for name, (kind, step, offset) in axes.items()
    )
    now = datetime.now(UTC).isoformat(timespec="seconds")
    maker = "<Manufacturer>pgfmd</Manufacturer><Model>pgfmd export</Model><Serial>none</Serial><Version>1</Version>"
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<p:ISO5436_2 xmlns:p="{_X3P_NAMESPACE}">
  <Record1>
    <Revision>ISO5436 - 2000</Revision>
    <FeatureType>SUR</FeatureType>
    <Axes>
{axis_records}    </Axes>
  </Record1>
  <Record2>
    <Date>{now}</Date>
    <Instrument>{maker}</Instrument>
    <CalibrationDate>{now}</CalibrationDate>
    <ProbingSystem><Type>Software</Type><Identification>computed, not measured</Identification></ProbingSystem>
    <Comment>{escape(surface.title)}</Comment>
  </Record2>
  <Record3>
    <MatrixDimension><SizeX>{columns}</SizeX><SizeY>{rows}</SizeY><SizeZ>1</SizeZ></MatrixDimension>
    <DataLink>
      <PointDataLink>bindata/data.bin</PointDataLink>
      <MD5ChecksumPointData>{checksum}</MD5ChecksumPointData>
    </DataLink>
  </Record3>
  <Record4><ChecksumFile>md5checksum.hex</ChecksumFile></Record4>
</p:ISO5436_2>
"""


def netcdf_bytes(surface: HeightMapFile) -> bytes:
    """A netCDF file (format 3), laid out as SurfaceTopography reads and writes it: heights(x, y) [m], and the coordinates with
    the size as `length`."""
    from scipy.io import netcdf_file

    file = io.BytesIO()
    data = netcdf_file(file, "w", version=2)
    data.title = surface.title.encode("ascii", "replace")
    for axis, name in enumerate("xy"):
        count = surface.z.shape[1 - axis]
        data.createDimension(name, count)
        variable = data.createVariable(name, "f8", (name,))
        variable[:] = surface.first[axis] + surface.pixel[axis] * np.arange(count)
        variable.units = variable.unit = b"m"
        # A plain number would be written in single precision.
        variable.length, variable.periodic = np.float64(surface.size[axis]), int(surface.periodic)
    heights = data.createVariable("heights", "f8", ("x", "y"))
    heights[:] = surface.z.T
    heights.units = heights.unit = b"m"
    heights.peaks = surface.peaks.encode()
    data.flush()
    content = file.getvalue()
    data.close()
    return content


MAP_FORMATS: dict[str, Callable[[HeightMapFile], bytes]] = {
    ".npy": npy_bytes, ".npz": npz_bytes, ".xyz": xyz_bytes, ".x3p": x3p_bytes, ".nc": netcdf_bytes,
}  # fmt: skip
"""Formats of height maps by the endings of their files."""
