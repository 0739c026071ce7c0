"""LZF decompression, the packing of binary_compressed PCD files."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel


@kernel
def lzf_decompress(packed: np.ndarray, out: np.ndarray) -> int:
    """Unpack LZF data (Lehmann's liblzf) into `out`.

    Parameters
    ----------
    packed : (P,) uint8
    out : (U,) uint8
        Filled with the unpacked bytes.

    Returns
    -------
    int
        Number of bytes unpacked, or -1 when the data is damaged or does not fit.
    """
    source, target = 0, 0
    while source < len(packed):
        control = int(packed[source])
        source += 1
        if control < 32:  # a run of control + 1 literal bytes
            length = control + 1
            if source + length > len(packed) or target + length > len(out):
                return -1
            for i in range(length):
                out[target + i] = packed[source + i]
            source += length
        else:  # a copy of earlier output; byte by byte, since it may overlap itself
            length = control >> 5
            if length == 7:
                if source >= len(packed):
                    return -1
                length += int(packed[source])
                source += 1
            if source >= len(packed):
                return -1
            reference = target - ((control & 31) << 8) - int(packed[source]) - 1
            source += 1
            length += 2
            if reference < 0 or target + length > len(out):
                return -1
            for i in range(length):
                out[target + i] = out[reference + i]
        target += length
    return target
