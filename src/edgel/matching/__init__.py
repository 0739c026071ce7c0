"""Rigid registration from edges: scans to scans, and parts of CAD to scenes."""

from edgel.matching._answer import SURE
from edgel.matching._files import FILES
from edgel.matching._model import Model
from edgel.matching._register import register
from edgel.matching._registration import Poses, Registration

__all__ = ["FILES", "SURE", "Model", "Poses", "Registration", "register"]
