"""How right an edge detection is, against edges that are known.

Two kinds of truth: a label per point (mesh vertices that lie exactly on an edge), and curves (sampled positions with a
tangent and the normals of both faces). Formulas stand in each docstring; a ratio whose denominator is 0 counts as 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import Neighbors, knn
from edgel.cloud import check_positions
from edgel.edges import EdgeKind

IGNORE = 2
"""Label of points that count neither way (soft bands of the published truth)."""


@dataclass(frozen=True)
class Scores:
    """Per-point scores of a two-class labelling (Powers 2011, arXiv:2010.16061).

    Attributes
    ----------
    tp, fp, fn, tn : int
        True and false positives, false and true negatives.
    """

    tp: int
    fp: int
    fn: int
    tn: int

    @property
    def precision(self) -> float:
        """``tp / (tp + fp)``: how much of what was found is true."""
        return _ratio(self.tp, self.tp + self.fp)

    @property
    def recall(self) -> float:
        """``tp / (tp + fn)``: how much of what is true was found."""
        return _ratio(self.tp, self.tp + self.fn)

    @property
    def f1(self) -> float:
        """``2 tp / (2 tp + fp + fn)``, the harmonic mean of precision and recall."""
        return _ratio(2 * self.tp, 2 * self.tp + self.fp + self.fn)

    @property
    def iou(self) -> float:
        """``tp / (tp + fp + fn)``, intersection over union (Jaccard)."""
        return _ratio(self.tp, self.tp + self.fp + self.fn)

    @property
    def mcc(self) -> float:
        """``(tp tn - fp fn) / sqrt((tp + fp)(tp + fn)(tn + fp)(tn + fn))`` (Matthews 1975).

        doi:10.1016/0005-2795(75)90109-9
        """
        tp, fp, fn, tn = self.tp, self.fp, self.fn, self.tn
        return _ratio(tp * tn - fp * fn, math.sqrt((tp + fp) * (tp + fn) * (tn + fp) * (tn + fn)))

    @property
    def false_per_thousand(self) -> float:
        """``1000 fp / (fp + tn)``: false positives in 1000 points that are no edge."""
        return _ratio(1000 * self.fp, self.fp + self.tn)


@dataclass(frozen=True)
class Matches:
    """Precision and recall within a distance.

    Attributes
    ----------
    precision : float
        Share of the predicted positions within the tolerance of a true one.
    recall : float
        Share of the true positions within the tolerance of a predicted one.
    """

    precision: float
    recall: float

    @property
    def f1(self) -> float:
        """``2 p r / (p + r)``."""
        return _ratio(2 * self.precision * self.recall, self.precision + self.recall)


@dataclass(frozen=True)
class Distances:
    """Distances between predicted and true positions, in the cloud's unit; infinite when one set is empty.

    With ``d(a, B)`` the distance of a to the nearest of B, P the predicted and T the true positions:

    Attributes
    ----------
    chamfer : float
        ``mean_P d(p, T) + mean_T d(t, P)`` (edge chamfer distance, as in Barrow et al. 1977 but of both sides).
    hausdorff : float
        ``max(max_P d(p, T), max_T d(t, P))``.
    mean_hausdorff : float
        ``max(mean_P d(p, T), mean_T d(t, P))`` (Dubuisson & Jain 1994, doi:10.1109/ICPR.1994.576361).
    """

    chamfer: float
    hausdorff: float
    mean_hausdorff: float


@dataclass(frozen=True)
class Spread:
    """Median and 95th percentile of errors; NaN when there are none."""

    median: float
    p95: float


def score_labels(predicted: np.ndarray, truth: np.ndarray) -> Scores:
    """Compare labels point by point, at zero tolerance.

    Parameters
    ----------
    predicted : (N,) bool
    truth : (N,) bool or int
        1 (True) on an edge, 0 off it, 2 ignored.

    Examples
    --------
    >>> import numpy as np
    >>> score_labels(np.array([True, True, False]), np.array([1, 0, 2])).precision
    0.5
    """
    if predicted.shape != truth.shape or predicted.dtype != bool:
        raise ValueError(f"predicted: expected bool of shape {truth.shape}, got {predicted.dtype} {predicted.shape}")
    counts = truth != IGNORE
    edge = truth == 1
    return Scores(
        tp=int(np.count_nonzero(predicted & edge)),
        fp=int(np.count_nonzero(predicted & ~edge & counts)),
        fn=int(np.count_nonzero(~predicted & edge)),
        tn=int(np.count_nonzero(~predicted & ~edge & counts)),
    )


def match(predicted: np.ndarray, truth: np.ndarray, tolerance: float) -> Matches:
    """Precision and recall of positions within a tolerance (predicted near a true one; true near a predicted one).

    Parameters
    ----------
    predicted : (P, 3) float64
    truth : (T, 3) float64
    tolerance : float
        In the cloud's unit; usually a multiple of the point spacing. A distance equal to it counts.
    """
    to_truth, to_predicted = _both_ways(predicted, truth)
    return Matches(_share(to_truth <= tolerance), _share(to_predicted <= tolerance))


def distances(predicted: np.ndarray, truth: np.ndarray) -> Distances:
    """Chamfer and Hausdorff distances between (P, 3) predicted and (T, 3) true positions."""
    if len(predicted) == 0 or len(truth) == 0:
        return Distances(math.inf, math.inf, math.inf)
    to_truth, to_predicted = _both_ways(predicted, truth)
    mean_p, mean_t = float(to_truth.mean()), float(to_predicted.mean())
    return Distances(mean_p + mean_t, float(max(to_truth.max(), to_predicted.max())), max(mean_p, mean_t))


def spread(errors: np.ndarray) -> Spread:
    """Median and 95th percentile of errors (M,), NaN ones left out."""
    errors = errors[~np.isnan(errors)]
    if len(errors) == 0:
        return Spread(math.nan, math.nan)
    return Spread(float(np.median(errors)), float(np.percentile(errors, 95)))


def line_angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle in radians, 0 to pi/2, between (M, 3) unit directions whose sign means nothing."""
    cross = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.arctan2(cross, np.abs((a * b).sum(axis=-1)))


def face_angles(predicted: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Angle in radians between the normals of both faces, whichever of the two is called first.

    Parameters
    ----------
    predicted : (M, 2, 3) float64
        Unit normals; NaN where a face is not known, which makes its error NaN.
    truth : (M, 2, 3) float64

    Returns
    -------
    (M, 2) float64
        Of the two ways to pair them, the one with the smaller sum.
    """
    straight = np.stack([line_angles(predicted[:, i], truth[:, i]) for i in (0, 1)], axis=1)
    crossed = np.stack([line_angles(predicted[:, 1 - i], truth[:, i]) for i in (0, 1)], axis=1)
    better = np.nan_to_num(crossed.sum(axis=1), nan=np.inf) < np.nan_to_num(straight.sum(axis=1), nan=np.inf)
    return np.where(better[:, None], crossed, straight)


def kind_confusion(predicted: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Count how kinds are told apart: entry [i, j] points of true kind i called j.

    Parameters
    ----------
    predicted, truth : (N,) uint8
        `EdgeKind` flags, 0 where there is no edge. A point that is several kinds counts once for each; a predicted kind
        that is among the true ones is no confusion with the others.

    Returns
    -------
    (K + 1, K + 1) int64
        Row and column 0 stand for no edge, then the kinds in the order of `EdgeKind`.
    """
    flags = [int(kind) for kind in EdgeKind]
    table = np.zeros((len(flags) + 1, len(flags) + 1), np.int64)
    table[0, 0] = np.count_nonzero((predicted == 0) & (truth == 0))
    for i, t in enumerate(flags, start=1):
        true = (truth & t) > 0
        table[i, 0] = np.count_nonzero(true & (predicted == 0))
        table[0, i] = np.count_nonzero((truth == 0) & ((predicted & t) > 0))
        for j, p in enumerate(flags, start=1):
            called = true & ((predicted & p) > 0)
            if i != j:
                called &= ((predicted & t) == 0) & ((truth & p) == 0)
            table[i, j] = np.count_nonzero(called)
    return table


def nearest(positions: np.ndarray, among: np.ndarray) -> Neighbors:
    """Return the nearest of `among` (T, 3), T > 0, of each position (M, 3).

    Raises
    ------
    ValueError
        If a position is not finite, or there are none to be nearest.
    """
    among = check_positions(among, "among")
    if len(among) == 0:
        raise ValueError("among: there are no positions; give at least one")
    return knn(build_index(among), check_positions(positions, "positions"), 1)


def _both_ways(predicted: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each predicted position to the nearest true one, and the reverse; infinite when there is none."""
    if len(predicted) == 0 or len(truth) == 0:
        return np.full(len(predicted), np.inf), np.full(len(truth), np.inf)
    return nearest(predicted, truth).distances[:, 0], nearest(truth, predicted).distances[:, 0]


def _share(flags: np.ndarray) -> float:
    return _ratio(int(np.count_nonzero(flags)), len(flags))


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else 0.0
