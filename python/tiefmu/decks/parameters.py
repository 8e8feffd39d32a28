"""Parameters of a deck: names for numbers, and arithmetic with them."""

import ast
import math
import operator
import re
from collections.abc import Callable

from .numbers import real

Value = float | int | str
LONGEST = 1000  # characters of an expression
OPERATORS: dict[type, Callable] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
FUNCTIONS: dict[str, Callable] = {
    **{name: getattr(math, name) for name in ("sqrt", "exp", "log", "log10", "sin", "cos", "tan", "asin", "acos")},
    **{name: getattr(math, name) for name in ("atan", "atan2", "sinh", "cosh", "tanh")},
    **{"abs": abs, "min": min, "max": max, "float": float, "int": math.trunc, "aint": math.trunc, "mod": math.fmod},
    **{"nint": lambda x: math.floor(abs(x) + 0.5) * math.copysign(1, x), "sign": math.copysign},
}
EXPONENT = re.compile(r"(?<![a-z_])(\d+\.?\d*|\.\d+)d([+-]?\d+)")  # 1.d0


class Scope:
    """Parameters of a file; those that it does not have are sought in `parent`, the file that includes it."""

    def __init__(self, parent: "Scope | None" = None):
        self.parent, self.names = parent, {}

    def find(self, name: str) -> Value:
        """KeyError where there is none."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.names:
                return scope.names[name]
            scope = scope.parent
        raise KeyError(name)

    def outermost(self) -> "Scope":
        scope = self
        while scope.parent is not None:
            scope = scope.parent
        return scope


def declared(word: str) -> tuple[str, str]:
    """Type (R, I or C) and name of a parameter, from e.g. "R thick" or "Rthick"; ValueError where it is none."""
    kind, name = word[:1].upper(), word[1:].strip().lower()
    if kind not in ("R", "I", "C") or not name:
        raise ValueError
    return kind, name


def typed(kind: str, value: Value) -> Value:
    """A value as a parameter of type R, I or C holds it."""
    if kind == "C":
        return str(value)
    number = real(value) if isinstance(value, str) else float(value)
    return math.trunc(number) if kind == "I" else number


def field(text: str, scope: Scope) -> str:
    """A field with the parameter that it names put in: &name or -&name. KeyError where there is none."""
    if not text.startswith(("&", "-&")):
        return text
    sign, name = text.split("&", 1)
    value = scope.find(name.strip().lower())
    if sign:
        value = -value if not isinstance(value, str) else f"-{value}"
    return repr(value) if isinstance(value, float) else str(value)


def evaluate(text: str, scope: Scope) -> float:
    """Value of an expression such as 2*thick + sqrt(a). ValueError says what is wrong; KeyError names an unknown
    parameter."""
    if len(text) > LONGEST:
        raise ValueError("is too long")
    plain = EXPONENT.sub(r"\1e\2", text.lower().replace("&", ""))
    try:
        tree = ast.parse(plain.strip(), mode="eval")
        found = value_of(tree.body, scope)
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError("is no expression") from None
    except (ArithmeticError, TypeError, ValueError) as error:
        raise ValueError(str(error) or "has no value") from None
    if isinstance(found, complex) or not math.isfinite(found):
        raise ValueError("has no finite value")
    return float(found)


def value_of(node: ast.AST, scope: Scope) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return float(node.value)
    if isinstance(node, ast.Name):
        if node.id == "pi" and "pi" not in scope.names:
            return math.pi
        value = scope.find(node.id)
        if isinstance(value, str):
            raise ValueError(f"'{node.id}' is a text")
        return float(value)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        return OPERATORS[type(node.op)](value_of(node.left, scope), value_of(node.right, scope))
    if isinstance(node, ast.UnaryOp) and type(node.op) in OPERATORS:
        return OPERATORS[type(node.op)](value_of(node.operand, scope))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function = FUNCTIONS.get(node.func.id)
        if function is None:
            raise ValueError(f"the function '{node.func.id}' is not understood")
        return float(function(*(value_of(one, scope) for one in node.args)))
    raise ValueError("holds what is no arithmetic")
