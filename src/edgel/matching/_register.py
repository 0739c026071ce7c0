"""`edgel.register`: where a source lies in a target."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel._stages import Stages
from edgel.edges import Edges
from edgel.matching._answer import register_prepared
from edgel.matching._model import Model
from edgel.matching._prepare import prepare
from edgel.matching._registration import Registration


def register(
    source: Any,
    target: Any,
    *,
    initial: Any = None,
    source_edges: Edges | None = None,
    target_edges: Edges | None = None,
    max_correspondence_distance: float | None = None,
) -> Registration:
    """Find where a source lies in a target: scan to scan and part to scene, from any start.

    Every pair of half-edges that look alike proposes a pose (a half-edge is the border of a face: a place, the
    direction into the face and its normal on the outside of the wedge, so that one pair fixes the rotation); other
    edges vote; edges and surface of both clouds verify, what a sensor looked through counts against; planes refine, and
    edges what planes leave free.

    Parameters
    ----------
    source : (N, 3) or (H, W, 3) array_like, Cloud, an object that carries points, or Model
    target : the same but a Model
        In the same unit. Clouds with a viewpoint (`Cloud.viewpoint`) tell more: their sensor saw where nothing is.
    initial : (4, 4) array_like, optional
        T_target_source to begin from, within about 5 degrees and 5 spacings; nothing else is tried then but poses 4
        spacings beside it, and whether creases contradict the best of them is not asked.
    source_edges, target_edges : Edges, optional
        What `edgel.detect` found in them; default: it is asked, for clouds of which no sensor is known with
        ``orient="outward"``.
    max_correspondence_distance : float, optional
        Distance of matches in the last steps of the refinement, in the clouds' unit. Default: 1.5 spacings of the
        coarser cloud.

    Returns
    -------
    Registration
        `Registration.found` says whether there is an answer, `Registration.margin` how far it is ahead of the next.

    Raises
    ------
    TypeError, ValueError
        If a cloud carries no coordinates or fewer than 3 finite ones, if edges belong to another cloud or have unknown
        sides, if `initial` is no rigid pose or the distance not above 0.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> part = edgel.synth.sample(edgel.synth.stepped_block(), pattern="blue_noise", spacing=1.5).cloud.xyz
    >>> moved = part[:, [1, 2, 0]] + [10.0, 20.0, 30.0]
    >>> found = edgel.register(part, moved)
    >>> bool(found.found), np.round(found.T_target_source[:3, 3], 1).tolist()
    (True, [10.0, 20.0, 30.0])
    """
    initial = None if initial is None else _as_pose(initial)
    if max_correspondence_distance is not None and not 0 < max_correspondence_distance < np.inf:
        raise ValueError(f"max_correspondence_distance: expected a length above 0, got {max_correspondence_distance}")
    stages = Stages()
    with stages("source"):
        mine = source.prepared if isinstance(source, Model) else prepare(source, source_edges, "source")
    with stages("target"):
        theirs = prepare(target, target_edges, "target")
    symmetries = source.symmetries if isinstance(source, Model) else None
    return register_prepared(mine, theirs, stages, initial, max_correspondence_distance, symmetries)


def _as_pose(initial: Any) -> np.ndarray:
    pose = np.asarray(initial, np.float64)
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise ValueError(f"initial: expected a finite (4, 4) pose, got shape {pose.shape}")
    rigid = np.abs(pose[:3, :3] @ pose[:3, :3].T - np.eye(3)).max() < 1e-3 and np.linalg.det(pose[:3, :3]) > 0
    if not rigid or np.abs(pose[3] - (0, 0, 0, 1)).max() > 1e-6:
        raise ValueError(
            "initial: expected a rotation and a shift, T_target_source; this one scales, shears or mirrors"
        )
    return pose
