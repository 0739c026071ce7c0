"""The kernels that gather evidence, neighbourhood by neighbourhood."""

from __future__ import annotations

import numpy as np

from edgel.evidence import sectors, sheets, through
from edgel.evidence.forest import IN_STEP, add_up, chance
from edgel.evidence.scales import fit_scales, spacing_of
from edgel.evidence.sectors import sector_gaps
from edgel.evidence.sheets import fit_sheets
from edgel.evidence.through import planes_through, span_planes
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
    room = np.empty((12, sheets.SHEETS))
    of_sheets, two, of_votes = np.empty(sheets.NUM_FEATURES), np.empty(sheets.SHEETS), np.empty(through.NUM_FEATURES)
    spanned = np.empty((3, through.PLANES), np.float32)
    off = np.zeros((through.VOTERS, through.PLANES), np.float32)
    score = np.empty(through.PLANES, np.float32)
    gaps, angles = np.zeros(2 * len(counts)), np.empty(k)
    begins, ends = np.empty(sectors.BINS), np.empty(sectors.BINS)
    for q in range(places.shape[0]):
        row, own = query_order[first + q], places[q, 0]
        features = out[row]
        relative(places[q], queries, first + q, xyz, vectors)
        spacing = spacing_of(squared[q])
        fit_scales(vectors, squared[q], scales, fitted, found)
        features[:cheap] = found
        at = cheap
        features[at : at + len(cloud)] = cloud
        at += len(cloud)
        for f in range(len(fits)):
            count, scale = min(fits[f, 0], k), fits[f, 1]
            fit_sheets(vectors, places[q], squared[q], count, spacing, normals[:, scale], room, of_sheets, two)
            features[at : at + len(of_sheets)] = of_sheets
            planes[row, f] = two
            at += len(of_sheets)
        span_planes(vectors, max(spacing, 1e-300), spanned, off)
        for j in range(len(votes)):
            planes_through(vectors, int(votes[j, 0]), spacing, votes[j, 1], cos_min, spanned, off, score, of_votes)
            features[at : at + len(of_votes)] = of_votes
            at += len(of_votes)
        sector_gaps(vectors, squared[q], normals[own], counts, angles, begins, ends, gaps)
        features[at : at + len(gaps)] = gaps
