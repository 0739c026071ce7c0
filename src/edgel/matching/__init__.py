"""Rigid registration from edges: scans to scans, and parts of CAD to scenes."""

from edgel.matching._mesh import FILES
from edgel.matching._model import Model
from edgel.matching._register import SURE, register
from edgel.matching._registration import Poses, Registration

__all__ = ["FILES", "SURE", "Model", "Poses", "Registration", "register"]
