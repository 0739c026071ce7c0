"""What is known of a fit of two faces, one row a curve, and the numbers that go with it."""

from __future__ import annotations

NORMALS, INWARD, BEND, OFFSETS, COUNTS, SIGMA = 0, 4, 8, 10, 12, 14
"""Of both faces in the profile: unit normals (a, b), directions into them (a, b), curvature across the edge, standard
deviation of the distance of a line from each, how many points, and their spread about them."""
POSITION_STD, RADIUS_STD, ANGLE_STD, TURN_STD = 16, 17, 18, 19
"""Standard deviations: of the place across the curve, the radius, the angle between the faces, and of the direction."""
STATE = 20
"""See below."""
RIPPLE = 21
"""Of circles: how far the face that is most like a cylinder goes in and out on the way round, as flat walls do."""
FIT = 22

NONE, EDGE_ALONE, MEASURED = 0, 1, 2
"""States: no fit, a fit to edge points and one face, a fit to two faces."""

UNKNOWNS = 10
"""Tilt of the axis (2), place of the origin across it (2), radius, height, turn of both faces (2), their bends (2)."""
CENTRE, SIZE, HEIGHT, TURN, BENT = 2, 4, 5, 6, 8
