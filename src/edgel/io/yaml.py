"""YAML as ROS and OpenCV write cameras in it: of plain values alone."""

from __future__ import annotations

import re
from typing import Any


def read_yaml(raw: bytes) -> Any:
    r"""Return the first document of a YAML file, matrices of OpenCV as mappings.

    Raises
    ------
    ValueError
        If it is no YAML, or refers from one part to another, which may make it larger than any memory.

    Examples
    --------
    >>> read_yaml(b"%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n   data: [ 1., 0. ]\n")
    {'K': {'rows': 3, 'data': [1.0, 0.0]}}
    """
    import yaml  # not at the top: most files are no cameras

    base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    loader = type("Loader", (base,), {})  # one of our own: constructors are kept by class
    for name in ("opencv-matrix", "opencv-nd-matrix"):
        loader.add_constructor(f"tag:yaml.org,2002:{name}", lambda this, node: this.construct_mapping(node, deep=True))
    text = re.sub(r"\A%YAML:\d\.\d[^\n]*\n", "", raw.decode("utf-8-sig"))  # OpenCV's own spelling of a directive
    try:
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, loader)):
            raise ValueError("it refers from one part to another; write the values out")
        return next(iter(yaml.load_all(text, loader)), None)
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())) from None
