"""The kernels that gather evidence, neighbourhood by neighbourhood."""

from __future__ import annotations

import numpy as np

from edgel.blocks import aligned
from edgel.evidence import sectors, sheets, through
from edgel.evidence.forest import IN_STEP, add_up, chance
from edgel.evidence.scales import fit_scales, spacing_of
from edgel.evidence.sectors import sector_gaps
from edgel.evidence.sheets import fit_sheets
from edgel.evidence.through import planes_through, span_planes
from edgel.lanes import LANES
from edgel.parallel import kernel


@kernel
def relative(places, queries, query, xyz, vectors):
    """Write the neighbours relative to the query into `vectors` (3, k)."""
    for axis in range(3):
        own, coordinates, row = queries[axis, query], xyz[axis], vectors[axis]
        for i in range(len(places)):
            row[i] = coordinates[places[i]] - own


@kernel
def describe(first, places, squared, queries, query_order, xyz, scales, features):
    """Write the cheap evidence of some points."""
    vectors, fitted, found = np.empty((3, places.shape[1])), np.zeros((len(scales), 4)), np.zeros(features.shape[1])
    for q in range(places.shape[0]):
        relative(places[q], queries, first + q, xyz, vectors)
        fit_scales(vectors, squared[q], scales, fitted, found)
        features[query_order[first + q]] = found


@kernel
def survey(
    first,
    places,
    squared,
    queries,
    query_order,
    xyz,
    asked,
    scales,
    cloud,
    trees,
    normals,
    likely,
):
    """Write the plane at each scale and, by the trees given, the chance of an edge, of the points at places `asked`."""
    cheap = 6 * len(scales) + 2
    vectors, fitted, found = np.empty((3, places.shape[1])), np.zeros((len(scales), 4)), np.zeros(cheap)
    features, totals = np.zeros((IN_STEP, cheap + len(cloud)), np.float32), np.empty(IN_STEP)
    features[:, cheap:] = cloud
    for begin in range(0, places.shape[0], IN_STEP):
        count = min(IN_STEP, places.shape[0] - begin)
        for i in range(count):
            q = begin + i
            relative(places[q], queries, first + q, xyz, vectors)
            fit_scales(vectors, squared[q], scales, fitted, found)
            normals[asked[query_order[first + q]]] = fitted
            features[i, :cheap] = found
        add_up(features[:count], trees, totals)
        for i in range(count):
            likely[asked[query_order[first + begin + i]]] = chance(totals[i])


@kernel
def examine(
    first, places, squared, queries, query_order, xyz, normals, cloud, scales, fits, votes, counts, cos_min, out, planes
):
    """Write all the evidence `out` (M, F) and the two planes of each fit (M, fits, 24) of some points.

    ``cloud`` (C,) follows the cheap evidence: what is typical of the cloud.
    """
    k = places.shape[1]
    cheap = 6 * len(scales) + 2
    vectors, fitted, found = np.empty((3, k)), np.zeros((len(scales), 4)), np.zeros(cheap)
    spanned = np.empty((3, through.PLANES), np.float32)
    off = np.zeros((through.VOTERS, through.PLANES), np.float32)
    score, of_votes = np.empty(through.PLANES, np.float32), np.empty(through.NUM_FEATURES)
    gaps, angles = np.zeros(2 * len(counts)), np.empty(k)
    begins, ends = np.empty(sectors.BINS), np.empty(sectors.BINS)
    _fit_all(first, places, squared, queries, query_order, xyz, normals, fits, cheap + len(cloud), out, planes)
    for q in range(places.shape[0]):
        row, own = query_order[first + q], places[q, 0]
        features = out[row]
        relative(places[q], queries, first + q, xyz, vectors)
        spacing = spacing_of(squared[q])
        fit_scales(vectors, squared[q], scales, fitted, found)
        features[:cheap] = found
        at = cheap
        features[at : at + len(cloud)] = cloud
        at += len(cloud) + len(fits) * sheets.NUM_FEATURES
        span_planes(vectors, max(spacing, 1e-300), spanned, off)
        for j in range(len(votes)):
            planes_through(vectors, int(votes[j, 0]), spacing, votes[j, 1], cos_min, spanned, off, score, of_votes)
            features[at : at + len(of_votes)] = of_votes
            at += len(of_votes)
        sector_gaps(vectors, squared[q], normals[own], counts, angles, begins, ends, gaps)
        features[at : at + len(gaps)] = gaps


@kernel
def _fit_all(first, places, squared, queries, query_order, xyz, normals, fits, begin, out, planes):
    """Fit two planes at each scale, to eight points in step: features into the columns of `out` from `begin` on."""
    num, k = places.shape
    vectors, around = aligned(3 * k * LANES).reshape(3, -1), aligned(4 * k * LANES).reshape(4, -1)
    features, hinges = aligned(sheets.NUM_FEATURES * LANES), aligned(sheets.SHEETS * LANES)
    room, spacings, own = sheets.make_room(), np.empty(LANES), np.empty(LANES, np.int64)
    for q in range(0, num, LANES):
        for lane in range(LANES):
            own[lane] = min(q + lane, num - 1)  # the last one stands in for those that are missing
            spacings[lane] = spacing_of(squared[own[lane]])
            for axis in range(3):
                for i in range(k):
                    place = places[own[lane], i]
                    vectors[axis, i * LANES + lane] = xyz[axis, place] - queries[axis, first + own[lane]]
        for f in range(len(fits)):
            count, scale = min(fits[f, 0], k), fits[f, 1]
            for lane in range(LANES):
                for i in range(count):
                    for axis in range(4):
                        around[axis, i * LANES + lane] = normals[places[own[lane], i], scale, axis]
            fit_sheets(vectors, around, count, spacings, room, features, hinges)
            for lane in range(min(LANES, num - q)):
                row, at = query_order[first + q + lane], begin + f * sheets.NUM_FEATURES
                out[row, at : at + sheets.NUM_FEATURES] = features[lane::LANES]
                planes[row, f] = hinges[lane::LANES]
