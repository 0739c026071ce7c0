"""The LAS header that suits a cloud: its version, point format and records."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import laspy
import numpy as np
from laspy.point import dims
from laspy.vlrs.vlrlist import VLRList

from edgel._objects import COLORS
from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.las_crs import crs_of, set_crs
from edgel.io.las_extra import declare_as_given

WAVEFORM = ("LASF_Spec", 65535)
"""User and number of the extended record that holds waveforms."""

# Point formats by those that have wave packets besides: lazrs packs none.
_WITHOUT_WAVES = {4: 1, 5: 3, 9: 6, 10: 8}
_DESCRIPTORS = range(100, 355)  # numbers of the records that describe wave packets


@contextmanager
def foreign_errors(path: object, doing: str) -> Iterator[None]:
    """Turn whatever laspy and lazrs raise over a damaged file into a FormatError."""
    try:
        yield
    except FormatError:
        raise
    except (MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:
        # A panic of lazrs (Rust) is a BaseException, which `except Exception` lets through; others of its kind pass.
        panic = type(error).__name__ == "PanicException"
        if not isinstance(error, Exception) and not panic:
            raise
        what = (
            "its compression is of an old or unknown kind, or damaged" if panic else str(error) or type(error).__name__
        )
        raise FormatError(
            f"{path}: {doing} failed ({what}); get the file again or convert it with `las2las` or PDAL"
        ) from None


def header_for(
    cloud: Cloud, attributes: dict[str, np.ndarray], said: dict[str, str], *, packed: bool
) -> laspy.LasHeader:
    """Return the header the cloud came with, as far as it still holds, or a new one.

    Parameters
    ----------
    cloud : Cloud
    attributes : dict of str to array
        Loses the wave packets where `packed`; extra dimensions get the names that the header has.
    said : dict of str to str
        Gets what is left out.
    packed : bool
        Whether the points will be LAZ.
    """
    given: Any = cloud.metadata.get("las_header")
    if isinstance(given, laspy.LasHeader):
        header = _header_as_given(given, attributes, said, packed=packed)
        if crs_of(given) == cloud.crs:
            return header
    else:
        # EPSG codes go into GeoTIFF keys, which formats below 6 have; formats from 6 on demand WKT.
        legacy = "scan_angle_rank" in attributes or (cloud.crs or "").upper().startswith("EPSG:")
        color = all(name in attributes for name in COLORS)
        point_format = (3 if color else 1) if legacy else 7 if color else 6
        if not legacy and color and "nir" in attributes:
            point_format = 8
        header = laspy.LasHeader(version="1.4", point_format=point_format)
        header.generating_software = "edgel"
    try:
        set_crs(header, cloud.crs)
    except FormatError:
        said["crs"] = "left out, it is neither WKT nor EPSG:n"
        set_crs(header, None)
    return header


def _header_as_given(
    given: laspy.LasHeader, attributes: dict[str, np.ndarray], said: dict[str, str], *, packed: bool
) -> laspy.LasHeader:
    point_format = given.point_format.id
    waves = point_format in _WITHOUT_WAVES
    if waves and packed:
        point_format = _WITHOUT_WAVES[point_format]
        for name in dims.WAVEFORM_FIELDS_NAMES:
            if attributes.pop(name, None) is not None:
                said[name] = "left out, LAZ has no wave packets; .las holds it"
    header = laspy.LasHeader(version=_version_for(given, point_format), point_format=laspy.PointFormat(point_format))
    for field in ("file_source_id", "system_identifier", "generating_software", "creation_date", "uuid"):
        setattr(header, field, getattr(given, field))
    header.global_encoding.value = given.global_encoding.value
    header.scales, header.offsets = np.array(given.scales), np.array(given.offsets)
    # COPC's own records describe an octree that plain LAZ has not; laspy writes compression and extra bytes anew.
    kept = [vlr for vlr in given.vlrs if vlr.user_id not in ("copc", "laszip encoded")]
    header.vlrs = VLRList([vlr for vlr in kept if type(vlr).__name__ != "ExtraBytesVlr"])
    evlrs = [evlr for evlr in given.evlrs or () if evlr.user_id != "copc"]
    if waves:
        _tell_of_waveforms(given, header, evlrs, said, packed=packed)
    header.evlrs = VLRList(evlrs)
    for extra in given.point_format.extra_dimensions:
        declare_as_given(header, extra, attributes)
    return header


def _tell_of_waveforms(
    given: laspy.LasHeader, header: laspy.LasHeader, evlrs: list[Any], said: dict[str, str], *, packed: bool
) -> None:
    """Keep waveforms that are an extended record; say of others, and of all in LAZ, that they stay behind."""
    if packed:
        said["waveforms"] = "left out, LAZ has no wave packets; .las holds them"
        evlrs[:] = [evlr for evlr in evlrs if (evlr.user_id, evlr.record_id) != WAVEFORM]
        kept = [vlr for vlr in header.vlrs if vlr.user_id != WAVEFORM[0] or vlr.record_id not in _DESCRIPTORS]
        header.vlrs = VLRList(kept)
        header.global_encoding.waveform_data_packets_internal = False
        header.global_encoding.waveform_data_packets_external = False
    elif what := waveforms_of(given):
        said["waveforms"] = f"not in the file: {what}"
        header.global_encoding.waveform_data_packets_internal = False


def waveforms_of(header: laspy.LasHeader) -> str | None:
    """Say where the waveforms of a file are if no extended record that laspy reads holds them, None otherwise."""
    if header.point_format.id not in _WITHOUT_WAVES:
        return None
    if any((evlr.user_id, evlr.record_id) == WAVEFORM for evlr in header.evlrs or ()):
        return None
    if header.global_encoding.waveform_data_packets_external:
        return "waveforms, in a .wdp file of the same name"
    if header.global_encoding.waveform_data_packets_internal:
        return "waveforms, in a record of LAS 1.3 behind the points"
    return None


def _version_for(given: laspy.LasHeader, point_format: int) -> str:
    """Return the version of a file where the point format belongs to it and can be written, else the first that has it.

    So 1.0, which is 1.2 but for a few unused fields, becomes 1.2.
    """
    version = str(given.version)
    if version in dims.supported_versions() and dims.is_point_fmt_compatible_with_version(point_format, version):
        return version
    return dims.preferred_file_version_for_point_format(point_format)
