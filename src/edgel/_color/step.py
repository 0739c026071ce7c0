"""The step at a point: where across it the gradient has its peak, and how the colors differ on either side."""

from __future__ import annotations

import math

import numpy as np

from edgel._color.gradient import TIE, biweight
from edgel._kernels.parallel import kernel, routine

_PEAK = 0.5  # least curvature of the gradient across the edge: a ramp has none, a sharp step some 1.5
_BAND = 0.75  # how far from the peak a point may lie, in spacings; those not nearest to it go later
_MARGIN = 0.25  # a neighbour nearer to the edge, in spacings, belongs to neither side


@kernel
def color_step(first, places, squared, queries, targets, xyz, at, raw, noise, normals, gradients, steps):
    """Contrast and significance of the step at a candidate, spacing, offset of the edge in spacings, and its tangent.

    All 0 where the gradient has no peak near the point.
    """
    k = places.shape[1]
    across = np.empty(k)
    for q in range(places.shape[0]):
        row = targets[first + q]
        n, d = normals[at[row]], gradients[at[row], 1:]
        radius = math.sqrt(squared[q, k - 1])
        spacing = math.sqrt(math.pi / k)  # in radii, as across
        for i in range(k):
            p = places[q, i]
            x = xyz[0, p] - queries[0, first + q]
            y = xyz[1, p] - queries[1, first + q]
            z = xyz[2, p] - queries[2, first + q]
            across[i] = (x * d[0] + y * d[1] + z * d[2]) / radius
        peak = _peak(places[q], squared[q], across, gradients, d)
        if not abs(peak) <= _BAND * spacing:
            continue
        contrast, significance = _sides(places[q], squared[q], across, peak, _MARGIN * spacing, raw, noise)
        out = steps[row]
        out[0], out[1], out[2], out[3] = contrast, significance, radius * spacing, peak / spacing
        out[4], out[5], out[6] = n[1] * d[2] - n[2] * d[1], n[2] * d[0] - n[0] * d[2], n[0] * d[1] - n[1] * d[0]


@routine
def _peak(places, squared, across, gradients, direction):
    """Where a parabola fitted to the gradient's part along `direction` has its peak, in radii; inf without a peak."""
    k = len(places)
    w0, w1, w2, w3, w4, m0, m1, m2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(k):
        own, t = gradients[places[i]], across[i]
        weight = biweight(squared[i], squared[k - 1])
        value = own[0] * abs(own[1] * direction[0] + own[2] * direction[1] + own[3] * direction[2])
        w0, w1, w2 = w0 + weight, w1 + weight * t, w2 + weight * t * t
        w3, w4 = w3 + weight * t * t * t, w4 + weight * t * t * t * t
        m0, m1, m2 = m0 + weight * value, m1 + weight * t * value, m2 + weight * t * t * value
    # Cramer's rule for m = a + b t + c t^2
    c00, c01, c02 = w2 * w4 - w3 * w3, w2 * w3 - w1 * w4, w1 * w3 - w2 * w2
    c11, c12, c22 = w0 * w4 - w2 * w2, w1 * w2 - w0 * w3, w0 * w2 - w1 * w1
    det = w0 * c00 + w1 * c01 + w2 * c02
    if not det > 1e-6 * w0 * w0 * w0:
        return np.inf
    a = (c00 * m0 + c01 * m1 + c02 * m2) / det
    b = (c01 * m0 + c11 * m1 + c12 * m2) / det
    c = (c02 * m0 + c12 * m1 + c22 * m2) / det
    return -0.5 * b / c if a > 0.0 and -c > _PEAK * a else np.inf


@routine
def _sides(places, squared, across, line, margin, raw, noise):
    """Contrast of the raw colors on either side of a line, and how many standard errors it is worth.

    Neighbours within the margin of the line belong to neither side.
    """
    k, count = len(places), raw.shape[1]
    sums, totals, squares = np.zeros((2, count)), np.zeros(2), np.zeros(2)
    spread = np.zeros(count)
    for again in range(2):
        for i in range(k):
            p, t = places[i], across[i] - line
            if abs(t) < margin * (1.0 - TIE) or math.isnan(raw[p, 0]):
                continue
            side, weight = int(t > 0.0), 1.0 - squared[i] / squared[k - 1]
            if again == 0:
                totals[side] += weight
                squares[side] += weight * weight
            for c in range(count):
                if again == 0:
                    sums[side, c] += weight * raw[p, c]
                else:
                    spread[c] += weight * (raw[p, c] - sums[side, c] / totals[side]) ** 2
        if not min(totals[0], totals[1]) > 0.0:
            return 0.0, 0.0
    left, right = totals[0] ** 2 / squares[0], totals[1] ** 2 / squares[1]  # as many points of equal weight
    if min(left, right) < 2.0:
        return 0.0, 0.0
    contrast, significance = 0.0, 0.0
    for c in range(count):
        step = sums[1, c] / totals[1] - sums[0, c] / totals[0]
        variance = spread[c] / (totals[0] + totals[1]) * (left + right) / (left + right - 2.0)
        contrast += step * step
        significance += step * step / max(variance, noise[c] * noise[c])
    return math.sqrt(contrast), math.sqrt(significance / (1.0 / left + 1.0 / right))
