"""Smoothing and gradient of the colors on a surface."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.frames import tangents
from edgel._kernels.parallel import kernel, routine

TIE = 1e-6  # relative difference below which rounding would decide


@kernel
def smooth_colors(first, places, squared, queries, targets, xyz, raw, smooth, residuals):
    """Weighted means of the raw colors, and how far each lies from the mean of the others, in standard deviations."""
    k, count = places.shape[1], raw.shape[1]
    for q in range(places.shape[0]):
        total, squares, own = 0.0, 0.0, 0.0
        mean, residual = smooth[first + q], residuals[first + q]
        mean[:] = 0.0
        for i in range(k):
            p = places[q, i]
            weight = biweight(squared[q, i], squared[q, k - 1])
            if math.isnan(raw[p, 0]):
                continue
            total += weight
            if p == first + q:
                own = weight
            else:
                squares += weight * weight
            for c in range(count):
                mean[c] += weight * raw[p, c]
        others = total - own
        for c in range(count):
            value = raw[first + q, c]
            if others > 0.0 and not math.isnan(value):
                left = abs(value - (mean[c] - own * value) / others)
                residual[c] = left / math.sqrt(1.0 + squares / (others * others))
            else:
                residual[c] = np.nan
            mean[c] = mean[c] / total if total > 0.0 else np.nan


@kernel
def color_gradient(first, places, squared, queries, targets, xyz, normals, smooth, gradients):
    """Di Zenzo's gradient: its length times the neighbourhood's radius, and its direction in space."""
    k, count = places.shape[1], smooth.shape[1]
    slopes = np.empty((count, 2))
    means = np.empty(count)
    for q in range(places.shape[0]):
        here, n = first + q, normals[first + q]
        if not n[0] * n[0] + n[1] * n[1] + n[2] * n[2] > 0.5 or squared[q, k - 1] == 0.0:
            continue
        radius = math.sqrt(squared[q, k - 1])
        ux, uy, uz, vx, vy, vz = tangents(n[0], n[1], n[2])
        total, ma, mb, aa, ab, bb = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        means[:], slopes[:] = 0.0, 0.0
        for i in range(k):
            p = places[q, i]
            weight = biweight(squared[q, i], squared[q, k - 1])
            if weight == 0.0 or math.isnan(smooth[p, 0]):
                continue
            x = (xyz[0, p] - queries[0, here]) / radius
            y = (xyz[1, p] - queries[1, here]) / radius
            z = (xyz[2, p] - queries[2, here]) / radius
            a, b = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz
            total, ma, mb = total + weight, ma + weight * a, mb + weight * b
            aa, ab, bb = aa + weight * a * a, ab + weight * a * b, bb + weight * b * b
            for c in range(count):
                value = smooth[p, c] - smooth[here, c]
                means[c] += weight * value
                slopes[c, 0] += weight * a * value
                slopes[c, 1] += weight * b * value
        if not total > 0.0:
            continue
        aa, ab, bb = aa - ma * ma / total, ab - ma * mb / total, bb - mb * mb / total
        det = aa * bb - ab * ab
        if not det > 0.01 * (aa + bb) ** 2:  # neighbours in a line (a scan line) say nothing of the color across it
            continue
        uu, uv, vv = 0.0, 0.0, 0.0
        for c in range(count):
            sa = slopes[c, 0] - ma * means[c] / total
            sb = slopes[c, 1] - mb * means[c] / total
            slopes[c, 0], slopes[c, 1] = (bb * sa - ab * sb) / det, (aa * sb - ab * sa) / det
            uu, uv = uu + slopes[c, 0] * slopes[c, 0], uv + slopes[c, 0] * slopes[c, 1]
            vv += slopes[c, 1] * slopes[c, 1]
        largest = 0.5 * (uu + vv) + math.sqrt(0.25 * (uu - vv) ** 2 + uv * uv)
        angle = 0.5 * math.atan2(2.0 * uv, uu - vv)
        cosine, sine, change = math.cos(angle), math.sin(angle), 0.0
        for c in range(count):  # the sign is that of the channel which changes most
            along = slopes[c, 0] * cosine + slopes[c, 1] * sine
            if abs(along) > abs(change) * (1.0 + TIE):
                change = along
        sign = -1.0 if change < 0.0 else 1.0
        cosine, sine = sign * cosine, sign * sine
        out = gradients[here]
        out[0] = math.sqrt(largest)
        out[1], out[2], out[3] = cosine * ux + sine * vx, cosine * uy + sine * vy, cosine * uz + sine * vz


@routine
def biweight(squared, largest):
    """Biweight kernel: its standard deviation along an axis is 0.35 of the radius."""
    share = 1.0 - squared / largest if largest > 0.0 else 1.0
    return share * share
