"""The kernels that gather evidence, neighbourhood by neighbourhood."""

from __future__ import annotations

import numpy as np

from edgel._kernels.arrays import copy_rows, copy_to
from edgel._kernels.parallel import kernel, routine
from edgel._kernels.rows import aligned
from edgel._kernels.simd import LANES
from edgel._neighbors.neighborhood import relative, stretch_normal, unstretch_normal
from edgel._neighbors.spacing import disc_spacing
from edgel._surface import hinge, minimal_planes, plane_scales, sectors, two_planes
from edgel._surface.forest import IN_STEP, add_up, logistic
from edgel._surface.hinge import unstretch_hinge
from edgel._surface.minimal_planes import planes_through, span_planes
from edgel._surface.plane_scales import fit_scales
from edgel._surface.sectors import sector_gaps
from edgel._surface.two_planes import fit_two_planes


@kernel
def screen(
    first,
    places,
    squared,
    queries,
    targets,
    xyz,
    scales,
    cloud,
    trees,
    normals,
    probability,
):
    """Write the plane at each scale and, by the trees given, the probability of an edge."""
    cheap = plane_scales.NUM_FEATURES
    vectors, fitted, found = np.empty((3, places.shape[1])), np.zeros((len(scales), 4)), np.zeros(cheap)
    features, totals = np.zeros((IN_STEP, cheap + len(cloud)), np.float32), np.empty(IN_STEP)
    for i in range(IN_STEP):
        copy_to(cloud, features[i, cheap:])
    for begin in range(0, places.shape[0], IN_STEP):
        count = min(IN_STEP, places.shape[0] - begin)
        for i in range(count):
            q = begin + i
            relative(places[q], queries, first + q, xyz, vectors)
            fit_scales(vectors, squared[q], scales, fitted, found)
            if queries.shape[0] > 3:
                for s in range(len(scales)):
                    unstretch_normal(queries[3:, first + q], fitted[s], 0)
            copy_rows(fitted, normals[targets[first + q]])
            copy_to(found, features[i])
        add_up(features[:count], trees, totals)
        for i in range(count):
            probability[targets[first + begin + i]] = logistic(totals[i])


@kernel
def gather_evidence(
    first, places, squared, queries, targets, xyz, normals, cloud, scales, fits, votes, counts, cos_min, out, planes
):
    """Write the evidence `out` (M, F), by `edgel._surface.features.POINT`, and the hinge of each fit (M, fits, 24).

    ``cloud`` (C,), the cloud-level statistics, follows the cheap evidence.
    """
    k = places.shape[1]
    cheap = plane_scales.NUM_FEATURES
    vectors, fitted, found = np.empty((3, k)), np.zeros((len(scales), 4)), np.zeros(cheap)
    spanned = np.empty((3, minimal_planes.PLANES), np.float32)
    off = np.zeros((minimal_planes.VOTERS, minimal_planes.PLANES), np.float32)
    score, of_votes = np.empty(minimal_planes.PLANES, np.float32), np.empty(minimal_planes.NUM_FEATURES)
    gaps, angles = np.zeros(2 * len(counts)), np.empty(k)
    begins, ends = np.empty(sectors.BINS), np.empty(sectors.BINS)
    frames = np.empty((len(scales), 4), np.float32)
    _fit_all(first, places, squared, queries, targets, xyz, normals, fits, cheap + len(cloud), out, planes)
    for q in range(places.shape[0]):
        row, own = targets[first + q], places[q, 0]
        features = out[row]
        relative(places[q], queries, first + q, xyz, vectors)
        spacing = disc_spacing(squared[q])
        fit_scales(vectors, squared[q], scales, fitted, found)
        copy_to(found, features)
        at = cheap
        copy_to(cloud, features[at:])
        at += len(cloud) + len(fits) * two_planes.NUM_FEATURES
        span_planes(vectors, max(spacing, 1e-300), spanned, off)
        for j in range(len(votes)):
            planes_through(vectors, int(votes[j, 0]), spacing, votes[j, 1], cos_min, spanned, off, score, of_votes)
            copy_to(of_votes, features[at:])
            at += len(of_votes)
        copy_rows(normals[own], frames)
        if queries.shape[0] > 3:
            for s in range(len(scales)):
                stretch_normal(queries[3:, first + q], frames[s], 0)
        sector_gaps(vectors, squared[q], frames, counts, angles, begins, ends, gaps)
        copy_to(gaps, features[at:])


@routine
def _fit_all(first, places, squared, queries, targets, xyz, normals, fits, begin, out, planes):
    """Fit two planes at each scale, to eight points in step: features into the columns of `out` from `begin` on."""
    num, k = places.shape
    vectors, around = aligned(3 * k * LANES).reshape(3, -1), aligned(4 * k * LANES).reshape(4, -1)
    stretched, away, plane = queries.shape[0] > 3, np.empty((3, k)), np.empty(4)
    features, hinges = aligned(two_planes.NUM_FEATURES * LANES), aligned(hinge.HINGE * LANES)
    scratch, spacings, own = two_planes.make_scratch(), np.empty(LANES), np.empty(LANES, np.int64)
    for q in range(0, num, LANES):
        for lane in range(LANES):
            own[lane] = min(q + lane, num - 1)  # the last one stands in for those that are missing
            spacings[lane] = disc_spacing(squared[own[lane]])
            relative(places[own[lane]], queries, first + own[lane], xyz, away)
            for axis in range(3):
                copy_to(away[axis], vectors[axis, lane::LANES])
        for f in range(len(fits)):
            count, scale = min(fits[f, 0], k), fits[f, 1]
            for lane in range(LANES):
                for i in range(count):
                    copy_to(normals[places[own[lane], i], scale], plane)
                    if stretched:
                        stretch_normal(queries[3:, first + own[lane]], plane, 0)
                    for axis in range(4):
                        around[axis, i * LANES + lane] = plane[axis]
            fit_two_planes(vectors, around, count, spacings, scratch, features, hinges)
            for lane in range(min(LANES, num - q)):
                row, at = targets[first + q + lane], begin + f * two_planes.NUM_FEATURES
                copy_to(features[lane::LANES], out[row, at:])
                copy_to(hinges[lane::LANES], planes[row, f])
                if stretched:
                    unstretch_hinge(queries[3:, first + q + lane], planes[row, f])
