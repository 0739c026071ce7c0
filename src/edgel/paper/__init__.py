"""The published method: project, Canny, back-project, and normals at the edge points only.

"Intelligent Point Cloud Edge Detection Method Based on Projection Transformation", Wireless Communications and Mobile
Computing (Hindawi). What it leaves open is chosen by measurement (docs/decisions.md), what it has wrong is listed with
the numbers recomputed in docs/errata.md.
"""

from edgel.paper.method import PaperEdges, detect

__all__ = ["PaperEdges", "detect"]
