"""LAS, LAZ and COPC writing by laspy: what a file said is said again, what is new goes into extra dimensions."""

from __future__ import annotations

import os

import laspy
import numpy as np

from edgel.cloud import Cloud
from edgel.io.columns import flat_attributes
from edgel.io.copc import as_copc, write_nodes
from edgel.io.errors import FormatError, tell
from edgel.io.files import COPC, replacing
from edgel.io.las_extra import fit_dimensions
from edgel.io.las_grid import choose_grid
from edgel.io.las_header import WAVEFORM, foreign_errors, header_for

# Before the data of an extended record come its names and its length.
_EVLR_HEADER = 60


def write(path: str | os.PathLike[str], cloud: Cloud) -> None:
    """Write a LAS file, a LAZ file when the name ends in ``.laz``, and COPC when it ends in ``.copc.laz``.

    A cloud read from LAS keeps its header: version (but 1.0 becomes 1.2), point format, records (VLR and EVLR), CRS,
    and scales and offsets as long as all points still lie on their grid. Otherwise the scale is the smallest power of
    ten for which the extent fits 32-bit integers (0.001 mm for a kilometre in metres), and the offset the largest round
    number below the smallest coordinate. Attributes that LAS does not know become extra dimensions, with a
    description; so does, as ``<name>_exact``, one whose values the dimension of its name cannot hold (an intensity of
    0..1). Organized shape and viewpoint are not kept, LAS has no place for them. LAZ has no wave packets. COPC sorts
    the points by the cubes of an octree, and is LAS 1.4 with point formats 6 to 8.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Warns
    -----
    FormatWarning
        If an attribute is left out or renamed, waveforms stay behind, or the CRS is neither WKT nor ``EPSG:n``.

    Raises
    ------
    FormatError
        If a coordinate is NaN or infinite.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(f"{folder}/a.las", Cloud(np.eye(3), {"label": np.arange(3)}))
    ...     laspy.read(f"{folder}/a.las")["label"]
    array([0, 1, 2])
    """
    name = os.fspath(path)
    num_bad = int((~np.isfinite(cloud.xyz).all(axis=1)).sum())
    if num_bad:
        raise FormatError(
            f"{name}: {num_bad} of {len(cloud)} points are NaN or infinite, which LAS cannot store; drop them "
            "(cloud.take(np.isfinite(cloud.xyz).all(axis=1))) or write .ply, .pcd or .npz"
        )
    said: dict[str, str] = {}
    packed, in_cubes = name.lower().endswith(".laz"), name.lower().endswith(COPC)
    attributes = flat_attributes(cloud, said, keep_arrays=True)
    with foreign_errors(name, "encoding LAS"):
        header = header_for(cloud, attributes, said, packed=packed)
        if in_cubes:
            as_copc(header, attributes, said)
        values = fit_dimensions(header, attributes, said)
        header.scales, header.offsets = choose_grid(
            cloud.xyz, header.scales, header.offsets, new="las_header" not in cloud.metadata
        )
        record = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
        for i, axis in enumerate("XYZ"):
            steps = (cloud.xyz[:, i] - header.offsets[i]) / header.scales[i]
            record[axis] = np.rint(steps).astype(np.int32)
        for dimension, column in values.items():
            record[dimension] = column
    tell(name, said)
    with replacing(path) as file:
        if in_cubes:
            write_nodes(file, header, record)
        else:
            _write_records(file, header, record, packed=packed)


def _write_records(file: object, header: laspy.LasHeader, record: laspy.ScaleAwarePointRecord, *, packed: bool) -> None:
    with laspy.LasWriter(file, header, do_compress=packed, closefd=False) as writer:  # pyright: ignore[reportArgumentType]
        writer.write_points(record)
        if not header.evlrs:
            return
        writer.write_evlrs(header.evlrs)
        place = writer.header.start_of_first_evlr
        for evlr in header.evlrs:
            if (evlr.user_id, evlr.record_id) == WAVEFORM:
                writer.header.start_of_waveform_data_packet_record = place
            place += _EVLR_HEADER + len(evlr.record_data_bytes())
