"""Edges in the image that a sensor saw: views, range images, facets, steps in depth and rims."""

from edgel._range_image.near_far import pixel_size, sides
from edgel._range_image.no_return import without_no_return
from edgel._range_image.range_image import RangeImage, organized, orthographic, pinhole, spherical
from edgel._range_image.seen_edges import SeenEdges, see_edges
from edgel._range_image.view import METHODS, View, choose_view, explaining_view

__all__ = [
    "METHODS",
    "RangeImage",
    "SeenEdges",
    "View",
    "choose_view",
    "explaining_view",
    "organized",
    "orthographic",
    "pinhole",
    "pixel_size",
    "see_edges",
    "sides",
    "spherical",
    "without_no_return",
]
