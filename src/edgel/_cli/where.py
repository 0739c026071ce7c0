"""``--where``: the points for which a condition on their columns holds, read by Python's grammar, never run as code."""

from __future__ import annotations

import ast
import difflib
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np

from edgel._cli.errors import ExitCode, Failure
from edgel.cloud import Cloud
from edgel.io.errors import printable

_LONGEST = 2000  # characters: whoever writes more wants another tool, and nesting stays shallow
_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], np.ndarray]] = {
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}
_GRAMMAR = "allowed are comparisons (== != < <= > >= in), and, or, not, brackets, columns, numbers and 'texts'"
_QUOTED = re.compile(r"""`([^`]+)`|'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*\"""")  # columns, and texts to leave alone


@dataclass(frozen=True)
class Where:
    """A condition on the points of a cloud.

    Its grammar is Python's, of which it takes comparisons, ``and``, ``or``, ``not``, ``in`` and ``not in`` a list of
    constants, brackets, numbers, texts, and the names of columns: x, y, z and the attributes. A name that is no word
    stands in backticks; of an attribute with several values a point, ``name[0]`` is the first.

    Parameters
    ----------
    text : str

    Raises
    ------
    Failure
        If the text is no such condition; that a cloud has no such column is told by `mask`.

    Examples
    --------
    >>> cloud = Cloud(np.eye(3), {"classification": np.array([2, 6, 6], np.uint8)})
    >>> Where("classification == 6 and not z > 0.5").mask(cloud).tolist()
    [False, True, False]
    """

    text: str

    def __post_init__(self) -> None:
        self._parse()

    def mask(self, cloud: Cloud) -> np.ndarray:
        """Return which points of a cloud the condition holds for, (N,) bool."""
        tree, quoted = self._parse()
        with np.errstate(invalid="ignore"):
            return _Condition(cloud, quoted).holds(tree)

    def ranges(self, cloud: Cloud) -> list[str]:
        """Say of the columns of numbers that the condition names what values they have."""
        tree, quoted = self._parse()
        named = [node for node in ast.walk(tree) if isinstance(node, ast.Name)]
        names = dict.fromkeys(quoted.get(node.id, node.id) for node in named)
        columns = {name: _Condition(cloud, quoted).plain(name) for name in names}
        finite = {name: values[np.isfinite(values)] for name, values in columns.items() if values.dtype.kind in "iuf"}
        return [f"{name} goes from {v.min():.9g} to {v.max():.9g}" for name, v in finite.items() if v.size]

    def _parse(self) -> tuple[ast.expr, dict[str, str]]:
        """Return the tree of the condition, and the names that stood in backticks by what stands for them there."""
        quoted: dict[str, str] = {}

        def stand_in(match: re.Match[str]) -> str:
            if match[1] is None:
                return match[0]
            word = f"_column_{len(quoted)}_"
            quoted[word] = match[1]
            return word

        if len(self.text) > _LONGEST:
            _fail(f"a condition of {len(self.text):,} characters, at most {_LONGEST:,} are read")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of escapes in texts, which Python will refuse one day
                tree = ast.parse(_QUOTED.sub(stand_in, " ".join(self.text.split())), mode="eval").body
        except SyntaxError as error:
            assigned = re.search(r"(?<![=!<>])=(?!=)", _QUOTED.sub("", self.text))
            hint = "; == compares" if assigned else "; a column whose name is no word stands in `backticks`"
            _fail(f"cannot be read ({error.msg}), in {self.text!r}{hint}")
        except (ValueError, RecursionError, MemoryError):
            _fail(f"cannot be read, in {self.text!r}; {_GRAMMAR}")
        _check(tree)
        return tree, quoted


def select(cloud: Cloud, where: Where | None) -> Cloud:
    """Return a cloud in which the points that a condition does not hold for have no place: NaN, so that rows stay."""
    if where is None:
        return cloud
    return replace(cloud, xyz=np.where(_some(cloud, where)[:, None], cloud.xyz, np.nan))


def take(cloud: Cloud, where: Where | None) -> Cloud:
    """Return the points that a condition holds for, as a list."""
    return cloud if where is None else cloud.take(_some(cloud, where))


def _some(cloud: Cloud, where: Where) -> np.ndarray:
    mask = where.mask(cloud)
    if not mask.any():
        there = "".join(f"; {line}" for line in where.ranges(cloud))
        raise Failure(ExitCode.DATA, f"--where: of {len(cloud):,} points none has {where.text}{there}")
    return mask


def _fail(what: str) -> NoReturn:
    raise Failure(ExitCode.USAGE, f"--where: {printable(what)}")


def _check(node: ast.expr) -> None:
    """Refuse whatever is not of the grammar."""
    match node:
        case ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
            for part in node.values if isinstance(node, ast.BoolOp) else [node.operand]:
                _check(part)
        case ast.Compare():
            _check_value(node.left)
            for operator, right in zip(node.ops, node.comparators, strict=True):
                if isinstance(operator, ast.In | ast.NotIn):
                    if not isinstance(right, ast.Tuple | ast.List | ast.Set):
                        _fail("in needs a list of constants, as in: classification in (2, 6)")
                    for entry in right.elts:
                        _constant(entry)
                elif type(operator) in _COMPARISONS:
                    _check_value(right)
                else:
                    _fail(f"{ast.unparse(node)!r} is no comparison of columns; {_GRAMMAR}")
            if not any(isinstance(part, ast.Name | ast.Subscript) for part in (node.left, *node.comparators)):
                _fail(f"{ast.unparse(node)!r} names no column")
        case ast.Name():
            return  # a column of flags; what type it has is known with the cloud
        case ast.BinOp(op=ast.BitAnd() | ast.BitOr()):
            _fail("write and, or instead of &, |")
        case _:
            _fail(f"{ast.unparse(node)!r} is no condition; {_GRAMMAR}")


def _check_value(node: ast.expr) -> None:
    match node:
        case ast.Name() | ast.Subscript(value=ast.Name(), slice=ast.Constant(value=int())):
            return
        case ast.BinOp(op=ast.BitAnd() | ast.BitOr()):
            _fail("write and, or instead of &, |")
        case _:
            _constant(node)


def _constant(node: ast.expr) -> float | str | bool:
    """Return the value of a constant; Python's grammar has no negative numbers, they are a sign and a number."""
    match node:
        case ast.Constant(value=str() | bool() as value):
            return value
        case ast.Constant(value=int() | float() as value) if abs(value) <= 1e300:
            return value
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as value)) if abs(value) <= 1e300:
            return -value
    _fail(f"{printable(ast.unparse(node), 80)!r} is neither a column nor a number nor a text; {_GRAMMAR}")


@dataclass(frozen=True)
class _Condition:
    """The evaluation of a checked tree on one cloud."""

    cloud: Cloud
    quoted: dict[str, str]

    def holds(self, node: ast.expr) -> np.ndarray:
        match node:
            case ast.BoolOp(op=operator, values=parts):
                join = np.logical_and if isinstance(operator, ast.And) else np.logical_or
                return join.reduce([self.holds(part) for part in parts])
            case ast.UnaryOp(operand=operand):
                return ~self.holds(operand)
            case ast.Compare():
                return np.logical_and.reduce(list(self.comparisons(node)))
        values, name = self.value(node)
        if values.dtype != bool:
            _fail(f"{name} is a number, no condition; compare it, as in: {name} != 0")
        return values

    def comparisons(self, node: ast.Compare) -> Iterator[np.ndarray]:
        """Yield the comparisons of a chain, as in ``0 < z < 2``."""
        left = self.value(node.left)
        for operator, part in zip(node.ops, node.comparators, strict=True):
            if isinstance(part, ast.Tuple | ast.List | ast.Set):
                found = np.zeros(len(self.cloud), bool)
                for entry in part.elts:
                    found |= self.compare(np.equal, left, self.value(entry))
                yield ~found if isinstance(operator, ast.NotIn) else found
            else:
                right = self.value(part)
                yield self.compare(_COMPARISONS[type(operator)], left, right)
                left = right

    def compare(self, operator: Callable[..., np.ndarray], left: tuple[Any, str], right: tuple[Any, str]) -> np.ndarray:
        (first, first_name), (second, second_name) = left, right
        if _is_text(first) != _is_text(second):
            text, number = (first_name, second_name) if _is_text(first) else (second_name, first_name)
            _fail(f"{text} is text and {number} is a number; compare like with like")
        return np.broadcast_to(operator(first, second), len(self.cloud))

    def value(self, node: ast.expr) -> tuple[Any, str]:
        """Return a column (N,) or a constant, and what to call it."""
        if isinstance(node, ast.Name):
            return self.column(self.quoted.get(node.id, node.id), None)
        if (
            isinstance(node, ast.Subscript)
            and isinstance(node.value, ast.Name)
            and isinstance(node.slice, ast.Constant)
        ):
            position: Any = node.slice.value
            return self.column(self.quoted.get(node.value.id, node.value.id), position)
        constant = _constant(node)
        return constant, repr(constant)

    def plain(self, name: str) -> np.ndarray:
        """Return a column as it is, (N,) or (N, C)."""
        if name in ("x", "y", "z"):
            return self.cloud.xyz[:, "xyz".index(name)]
        if name in self.cloud.attributes:
            return self.cloud.attributes[name]
        names = ["x", "y", "z", *self.cloud.attributes]
        close = difflib.get_close_matches(name.lower(), names, 1)
        meant = f", perhaps {close[0]}" if close else ""
        _fail(f"there is no column {name!r}{meant}; there are {', '.join(names)}")

    def column(self, name: str, position: int | None) -> tuple[np.ndarray, str]:
        """Return a column with one value a point, (N,), and what to call it."""
        values = self.plain(name)
        if values.ndim > 1:
            values = values.reshape(len(values), -1)
            width = values.shape[1]
            if position is None or not 0 <= position < width:
                _fail(f"{name} has {width} values a point; choose one, from {name}[0] to {name}[{width - 1}]")
            values, name = values[:, position], f"{name}[{position}]"
        elif position is not None:
            _fail(f"{name} has one value a point; leave out [{position}]")
        if values.dtype.kind in "OS":
            values = np.array([v.decode(errors="replace") if isinstance(v, bytes) else str(v) for v in values], str)
        if values.dtype.kind not in "biufU":
            _fail(f"{name} holds neither numbers nor texts ({values.dtype}); choose another column")
        return values, name


def _is_text(value: Any) -> bool:
    return value.dtype.kind == "U" if isinstance(value, np.ndarray) else isinstance(value, str)
