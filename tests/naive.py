"""The slow, obvious version of every step: plain loops straight from the equations, the oracle of the kernels.

Pixels are counted from 1 as in the paper, and images are indexed ``f[j - 1][i - 1]``.
"""

import math

import numpy as np


def pixel_coordinates(x, y, xmin, xmax, ymin, ymax, W, H):
    """Eq. 3-4, floored to half-open cells; the last column and row take xmax and ymax."""
    i = math.floor(W * (x - xmin) / (xmax - xmin)) + 1
    j = math.floor(H * (y - ymin) / (ymax - ymin)) + 1
    return min(i, W), min(j, H)


def project(points, W, H, gray_min):
    """Eq. 1-6: the grey image of a cloud; 0 where no point falls, the highest point where several do."""
    xmin, ymin, zmin = (min(p[a] for p in points) for a in range(3))
    xmax, ymax, zmax = (max(p[a] for p in points) for a in range(3))
    f = [[0.0] * W for _ in range(H)]
    top = {}
    for x, y, z in points:
        pixel = pixel_coordinates(x, y, xmin, xmax, ymin, ymax, W, H)
        top[pixel] = max(top.get(pixel, -math.inf), z)
    for (i, j), z in top.items():
        f[j - 1][i - 1] = gray_min + (255 - gray_min) * (z - zmin) / (zmax - zmin) if zmax > zmin else 255.0
    return np.array(f)


def gaussian_kernel(k, sigma):
    """Eq. 7 over (2k + 1) x (2k + 1), then divided by its sum."""
    size = 2 * k + 1
    h = np.zeros((size, size))
    for i in range(1, size + 1):
        for j in range(1, size + 1):
            h[i - 1, j - 1] = math.exp(-((i - (k + 1)) ** 2 + (j - (k + 1)) ** 2) / (2 * sigma**2))
            h[i - 1, j - 1] /= 2 * math.pi * sigma**2
    return h / h.sum()


def _at(f, row, col):
    """A pixel, the nearest border pixel where it lies outside."""
    return f[min(max(row, 0), f.shape[0] - 1), min(max(col, 0), f.shape[1] - 1)]


def convolve(f, h):
    """Eq. 12: every pixel the sum of its window weighted by h."""
    k = h.shape[0] // 2
    out = np.zeros(f.shape)
    for row in range(f.shape[0]):
        for col in range(f.shape[1]):
            for a in range(-k, k + 1):
                for b in range(-k, k + 1):
                    out[row, col] += h[a + k, b + k] * _at(f, row + a, col + b)
    return out


def gradient(f):
    """Eq. 15: Sobel."""
    sobel_x = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]])
    sobel_y = np.array([[-1, -2, -1], [0, 0, 0], [1, 2, 1]])
    return convolve(f, sobel_x), convolve(f, sobel_y)


def non_maximum_suppression(gx, gy):
    """Section 3.3: of the three pixels along the gradient (rounded to 45 degrees) only the largest stays."""
    magnitude = np.hypot(gx, gy)
    height, width = magnitude.shape
    out = np.zeros_like(magnitude)

    def m(row, col):
        return magnitude[row, col] if 0 <= row < height and 0 <= col < width else 0.0

    for row in range(height):
        for col in range(width):
            theta = math.degrees(math.atan2(gy[row, col], gx[row, col])) % 180
            here = magnitude[row, col]
            if theta < 22.5 or theta > 157.5:
                stays = here > m(row, col - 1) and here >= m(row, col + 1)
            elif 67.5 < theta < 112.5:
                stays = here > m(row - 1, col) and here >= m(row + 1, col)
            elif theta < 90:
                stays = here > m(row - 1, col - 1) and here > m(row + 1, col + 1)
            else:
                stays = here > m(row - 1, col + 1) and here > m(row + 1, col - 1)
            out[row, col] = here if stays else 0.0
    return out


def hysteresis(thinned, low, high):
    """Section 3.4 with chains: repeat the paper's neighbour rule until nothing changes."""
    edges = thinned > high
    changed = True
    while changed:
        changed = False
        for row in range(thinned.shape[0]):
            for col in range(thinned.shape[1]):
                if not edges[row, col] and thinned[row, col] > low:
                    window = edges[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2]
                    if window.any():
                        edges[row, col] = changed = True
    return edges


def canny(f, k, sigma, low, high):
    """Sections 3.1-3.4 in a row."""
    gx, gy = gradient(convolve(f, gaussian_kernel(k, sigma)))
    return hysteresis(non_maximum_suppression(gx, gy), low, high)


def code_1(points, edges, t, frame=0):
    """The paper's Code 1, corrected: ``temp`` cleared for every pixel, each point once. Returns the set of rows.

    With a frame, i and j of the edge map run from 1 - frame to W + frame and H + frame.
    """
    H, W = edges.shape[0] - 2 * frame, edges.shape[1] - 2 * frame
    f = np.asarray(points)
    xmin, ymin = f[:, 0].min(), f[:, 1].min()
    xmax, ymax = f[:, 0].max(), f[:, 1].max()
    pc = set()
    for row, col in zip(*np.nonzero(edges), strict=True):
        i, j = int(col) + 1 - frame, int(row) + 1 - frame
        newx = (i - 1) * (xmax - xmin) / W + xmin  # eq. 18
        newy = (j - 1) * (ymax - ymin) / H + ymin  # eq. 19
        m = np.flatnonzero(np.abs(f[:, 0] - newx) < t)
        n = np.flatnonzero(np.abs(f[:, 1] - newy) < t)
        pc.update(np.intersect1d(m, n).tolist())
    return pc


def nearest(points, query, k):
    """Rows of the k nearest points, ties to the smaller x, y, z, then to the smaller row."""
    keys = []
    for row, p in enumerate(points):
        d = sum((a - b) ** 2 for a, b in zip(p, query, strict=True))
        keys.append((d, *p, row))
    return [key[-1] for key in sorted(keys)[:k]]


def plane(neighbours):
    """Eq. 20 by SVD: unit normal (sign open), D, e, and the singular values of the centred neighbours."""
    centre = neighbours.mean(axis=0)
    _, s, vt = np.linalg.svd(neighbours - centre)
    normal = vt[2]
    distances = neighbours @ normal - centre @ normal
    return normal, normal @ centre, (distances**2).sum(), s


def nearest_points(pixels, depth, points):
    """Row of the point each pixel shows: the nearest, of equally near ones that of smallest coordinates."""
    shown = {}
    for p, pixel in enumerate(pixels):
        if pixel not in shown or (depth[p], *points[p]) < (depth[shown[pixel]], *points[shown[pixel]]):
            shown[pixel] = p
    return shown


def discs(columns, downs, distance, width, height, radius):
    """Point that shows in each pixel when every point is a disc round the middle of its pixel: the nearest.

    Points hidden in their own pixel have no disc. Of points as near, the lowest shows, then the rightmost.
    """

    def nearest(candidates):
        return min(candidates, key=lambda p: (distance[p], -downs[p], -columns[p], p), default=-1)

    pixel = [(math.floor(down), math.floor(column)) for down, column in zip(downs, columns, strict=True)]
    every = range(len(pixel))
    on_top = [p for p in every if nearest([q for q in every if pixel[q] == pixel[p]]) == p]
    shown = np.empty((height, width), int)
    for row in range(height):
        for col in range(width):
            over = [p for p in on_top if (pixel[p][0] - row) ** 2 + (pixel[p][1] - col) ** 2 <= radius**2]
            shown[row, col] = nearest(over)
    return shown


def held(near, close, least=(2, 4), lines=(1, 1)):
    """Pixels that enough neighbours hold: of the 8 or of the 24 within `close`, of the 24 with 3 median steps more."""
    kept = np.full(near.shape, np.nan)
    for row, col in np.argwhere(~np.isnan(near)):

        def holding(reach, limit, row=row, col=col):
            down, right = reach * lines[0], reach * lines[1]
            window = near[max(row - down, 0) : row + down + 1, max(col - right, 0) : col + right + 1]
            return np.sum(np.abs(window - near[row, col]) <= limit) - 1

        window = near[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3]
        steps = [np.abs(np.diff(window, axis=axis)) for axis in (0, 1) if lines[axis]]
        slack = 3 * max((np.median(s[~np.isnan(s)]) for s in steps if not np.isnan(s).all()), default=0.0)
        limit = close[row, col]
        if holding(1, limit) >= least[0] or holding(2, limit) >= least[1] or holding(2, limit + slack) >= least[1]:
            kept[row, col] = near[row, col]
    return kept


def window_planes(ray, near, cell, halves, full):
    """Least squares of `near` by rays in windows of cells (S, I, J, 4): plane, and root mean square; inf if unknown."""
    rows, cols = (math.ceil(length / size) for length, size in zip(near.shape, cell, strict=True))
    planes = np.full((len(halves), rows, cols, 4), np.inf)
    for s, half in enumerate(halves):
        for i in range(rows):
            for j in range(cols):
                window = np.s_[
                    max(i - half, 0) * cell[0] : (i + half + 1) * cell[0],
                    max(j - half, 0) * cell[1] : (j + half + 1) * cell[1],
                ]
                seen = ~np.isnan(near[window])
                if seen.sum() < full * (2 * half + 1) ** 2 * cell[0] * cell[1]:
                    continue
                a, b = ray[window][seen], near[window][seen]
                plane, _, rank, _ = np.linalg.lstsq(a, b, rcond=None)
                if rank == 3:
                    left = math.sqrt(((a @ plane - b) ** 2).sum() / max(len(b) - 3, 1))
                    planes[s, i, j] = (*plane, left)
    return planes


def voids(hole, size):
    """Pixels in rectangles of a size (rows, columns) that are all hole."""
    void = np.zeros_like(hole)
    for row in range(hole.shape[0] - size[0] + 1):
        for col in range(hole.shape[1] - size[1] + 1):
            if hole[row : row + size[0], col : col + size[1]].all():
                void[row : row + size[0], col : col + size[1]] = True
    return void


def rims(hole, void):
    """Pixels seen that have one of their 4 neighbours in a void."""
    padded = np.pad(void, 1)
    beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    return beside & ~hole


def biweight(points):
    """Weights of neighbours, relative to the point, that vanish at the farthest."""
    squared = (points**2).sum(axis=1)
    return (1 - squared / squared.max()) ** 2


def color_gradient(points, normal, colors):
    """Di Zenzo's gradient at the origin times the radius, and its direction: per channel a plane, then the tensor."""
    u = np.linalg.svd(normal[None])[2][1]
    v = np.cross(normal, u)
    root = np.sqrt(biweight(points))
    design = np.column_stack([np.ones(len(points)), points @ u, points @ v])
    slopes = np.linalg.lstsq(design * root[:, None], colors * root[:, None], rcond=None)[0][1:].T
    values, vectors = np.linalg.eigh(slopes.T @ slopes)
    direction = vectors[:, 1]
    changes = slopes @ direction
    direction = direction * np.sign(changes[np.argmax(np.abs(changes))])
    radius = np.sqrt((points**2).sum(axis=1).max())
    return math.sqrt(values[1]) * radius, direction[0] * u + direction[1] * v


def color_peak(points, values, direction):
    """Where along `direction` a parabola through the gradient's values has its peak, in radii; inf without one."""
    radius = np.sqrt((points**2).sum(axis=1).max())
    c, b, a = np.polyfit(points @ direction / radius, values, 2, w=np.sqrt(biweight(points)))
    return -b / (2 * c) if a > 0 and -c > 0.5 * a else math.inf


def thin_abreast(points, across, spacing, offsets):
    """Rows that stay when one after the other, nearest to the edge first, drops those abreast of it."""
    ranked = sorted(
        range(len(points)), key=lambda i: (round(abs(offsets[i]) * 1e6), offsets[i] > 0, *points[i].tolist())
    )
    kept = []
    for i in ranked:
        free = True
        for j in kept:
            side = (points[j] - points[i]) @ across[i]
            along = math.sqrt(max(((points[j] - points[i]) ** 2).sum() - side**2, 0))
            if along < 0.75 * spacing[i] and 0.25 * spacing[i] < abs(side) < 1.5 * spacing[i]:
                free = False
        if free:
            kept.append(i)
    return kept


def covariance_plane(points):
    """Normal, surface variation, and middle over largest eigenvalue of the covariance of points."""
    values, vectors = np.linalg.eigh(np.cov(points.T, bias=True))
    return vectors[:, 0], values[0] / values.sum(), values[1] / values[2]


def plane_residual(points):
    """Sum of the squared distances of points to their best plane."""
    return np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[2] ** 2


def quadric_residual(points):
    """Squares left by a quadric over the plane of the points, along its normal."""
    normal = covariance_plane(points)[0]
    u, v = np.linalg.svd(normal[None])[2][1:]
    radius = np.linalg.norm(points, axis=1).max()
    x, y, z = (points @ u / radius, points @ v / radius, points @ normal / radius)
    terms = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    left = z - terms @ np.linalg.lstsq(terms, z, rcond=None)[0]
    return (left**2).sum() * radius**2


def two_widest_sectors(xy):
    """The two widest empty sectors between the directions of points in the plane, radians."""
    xy = xy[(xy != 0).any(axis=1)]
    angles = np.sort(np.arctan2(xy[:, 1], xy[:, 0]))
    gaps = np.sort(np.diff(np.append(angles, angles[0] + 2 * np.pi)))
    return gaps[-1], gaps[-2]


def walk_trees(forest, row):
    """Sum of the leaves that a row of features comes to, as a probability."""
    total = 0.0
    for root in forest.roots:
        node = root
        while forest.feature[node] >= 0:
            node = node + 1 if row[forest.feature[node]] <= forest.threshold[node] else forest.right[node]
        total += float(forest.threshold[node])
    return 1 / (1 + np.exp(-total))


def chains_kept(values, weak, least, threshold):
    """Pixels of chains of 8-neighbours above weak * threshold that hold one of the threshold and `least` in all."""
    above, kept = values >= weak * threshold, np.zeros(values.shape, bool)
    seen = np.zeros(values.shape, bool)
    for start in zip(*np.nonzero(above), strict=True):
        if seen[start]:
            continue
        chain, waiting = [], [start]
        seen[start] = True
        while waiting:
            row, col = waiting.pop()
            chain.append((row, col))
            for r in range(max(row - 1, 0), min(row + 2, values.shape[0])):
                for c in range(max(col - 1, 0), min(col + 2, values.shape[1])):
                    if above[r, c] and not seen[r, c]:
                        seen[r, c] = True
                        waiting.append((r, c))
        if len(chain) >= least and max(values[at] for at in chain) >= threshold:
            for at in chain:
                kept[at] = True
    return kept


def two_planes_through(points, spanning, inlier, least_angle):
    """The best supported plane through the origin (row 0) and the best that differs, by the names of the features."""

    def best(votes, other):
        answer, most = None, 0.0
        for i in range(1, spanning + 1):
            for j in range(i + 1, spanning + 1):
                normal = np.cross(points[i], points[j])
                area = np.linalg.norm(normal)
                if area <= 0.3:
                    continue
                normal = normal / area
                if other is not None and abs(normal @ other) > math.cos(least_angle):
                    continue
                off = np.abs(votes @ normal)
                score = (1 - 0.5 * off / inlier)[off < inlier].sum()
                if score > most:
                    answer, most = normal, score
        return answer, most

    a, first = best(points[1:], None)
    found = {"angle": 0.0, "first_support": first, "second_support": 0.0, "first_balance": 1.0, "second_balance": 1.0}
    if a is None:
        return found
    b, found["second_support"] = best(points[1:][np.abs(points[1:] @ a) >= inlier], a)
    if b is not None:
        found["angle"] = math.acos(min(abs(a @ b), 1))
        found["first_balance"] = balance(points[1:], a, b, inlier)
        found["second_balance"] = balance(points[1:], b, a, inlier)
    return found


def plane_scale(points, spacing):
    """Features of the plane fitted to the neighbours of a point at the origin (row 0), by name."""
    normal, variation, roundness = covariance_plane(points)
    centroid, deviation = points.mean(axis=0), math.sqrt(points.var(axis=0).sum())
    off = abs(centroid @ normal)
    smallest = math.sqrt(max(np.linalg.eigvalsh(np.cov(points.T, bias=True))[0], 0))
    return {
        "variation": math.log(variation + 1e-6),
        "roundness": roundness,
        "off_plane": off / deviation,
        "off_centre": math.sqrt(max(centroid @ centroid - off**2, 0)) / deviation,
        "off_spread": min(off / (smallest + 0.01 * deviation), 4),
        "reach": np.linalg.norm(points, axis=1).max() / spacing,
    }


def two_planes(hinge, points, spacing):
    """Features of two planes (a dict of the parts of a hinge) fitted to the neighbours of a point at the origin."""
    a, b, line, foot = (hinge[name] for name in ("first_normal", "second_normal", "line", "foot"))
    radius, count = np.linalg.norm(points, axis=1).max(), len(points)
    first = points @ hinge["parting"][:3] > hinge["parting"][3]
    sides = [points[first], points[~first]]
    left = [plane_residual(side) for side in sides]
    logs = [
        math.log(math.sqrt(squares / count) / spacing + 0.01)
        for squares in (plane_residual(points), quadric_residual(points), sum(left))
    ]
    along = [(side - foot) @ line for side in sides]
    across = [np.linalg.norm(side - foot - far[:, None] * line, axis=1) for side, far in zip(sides, along, strict=True)]
    beside = np.concatenate(along)[np.concatenate(across) < 1.5 * spacing]
    margins = []
    for step in (-0.6, -0.3, 0, 0.3, 0.6):
        place = foot + step * spacing * line
        others = np.linalg.norm(points[1:16] - place, axis=1)
        margins.append(np.linalg.norm(place) - others.min())
    away = np.linalg.norm(foot) / spacing
    return {
        "one_plane": logs[0],
        "quadric": logs[1],
        "two_planes": logs[2],
        "turn": math.acos(min(abs(a @ b), 1)),
        "smaller_side": min(map(len, sides)) / count,
        "foot_away": min(away, 4),
        "off_first": min(abs(a @ foot) / spacing, 4),
        "off_second": min(abs(b @ foot) / spacing, 4),
        "near_sides": min(max(side.min() for side in across) / spacing, 4),
        "far_sides": min(side.max() for side in across) / radius,
        "along": min(max(-beside.min(), 0), max(beside.max(), 0)) / radius,
        "margin": min(min(margins) / spacing, 2) if away < 3 else 2,
        "quadric_gain": logs[2] - logs[1],
    }


def balance(points, normal, other, inlier):
    """Inliers of a plane through the origin on the emptier side of its line with another, over the fuller."""
    line = np.cross(normal, other)
    across = np.cross(normal, line / np.linalg.norm(line))
    beside = points[np.abs(points @ normal) < inlier] @ across
    sides = (beside > 0.4).sum(), (beside < -0.4).sum()
    return min(sides) / max(*sides, 1)


def back_project(depth, scale, fx, fy, cx, cy):
    """The pinhole camera: points (H, W, 3) of depths (H, W), NaN where there is none."""
    xyz = np.full((*depth.shape, 3), math.nan)
    for row, line in enumerate(depth.tolist()):
        for col, count in enumerate(line):
            z = count * scale
            if 0 < z < math.inf:
                xyz[row, col] = (col - cx) / fx * z, (row - cy) / fy * z, z
    return xyz


def octree_leaves(points, size, most, fewest, levels):
    """Sets of points (rows) that lie in the same leaf: cells of a grid, cut in eight while too full."""

    def cut(rows, size, level):
        if len(rows) <= most or level == levels:
            return [rows]
        parts = {}
        for row in rows:
            parts.setdefault(tuple(math.floor(c / (size / 2)) for c in points[row]), []).append(row)
        small = [key for key in sorted(parts) if len(parts[key]) <= most]
        if small:
            largest = max(small, key=lambda key: len(parts[key]))  # of several the first
            for key in [k for k in small if len(parts[k]) < fewest and k != largest]:
                parts[largest] += parts.pop(key)
            return [parts.pop(largest)] + [leaf for rows in parts.values() for leaf in cut(rows, size / 2, level + 1)]
        return [leaf for rows in parts.values() for leaf in cut(rows, size / 2, level + 1)]

    cells = {}
    for row, point in enumerate(points):
        cells.setdefault(tuple(math.floor(c / size) for c in point), []).append(row)
    return {frozenset(leaf) for rows in cells.values() for leaf in cut(rows, size, 0)}
