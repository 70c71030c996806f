"""What a person types into a number: arithmetic with units, worked out here and never run as a program.

    entry   := ["+=" | "-=" | "*=" | "/=" | "*" | "/"] sum
    sum     := product (("+" | "-") product)*
    product := joined (("*" | "/") joined)*          a constant may follow without a sign: 1/2 pi
    joined  := power unit*                           30 cm; binds more than a division: 72 km / 2 h
    power   := ["+" | "-"] atom ["^" power]
    atom    := number | constant | unit | function "(" sum ("," sum)* ")" | "(" sum ")"

A number without a unit is in the field's own. Where 1/3 m would be one over three metres and the field takes a length, it is a
third of a metre: what does not fit is read once more with units bound as weakly as a division.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, NoReturn

from elys.common.errors import ElysError
from elys.editor_node.units import PLAIN, UNITS, Dimension, Unit, described, similar_names, units_of

MAX_LENGTH: Final = 200  # characters
MAX_DEPTH: Final = 24  # of parentheses, signs and powers in one another

Operation = Literal["=", "+", "-", "*", "/"]
CONSTANTS: Final[Mapping[str, float]] = {"pi": math.pi, "π": math.pi, "tau": math.tau, "e": math.e}
_PLAIN_FUNCTIONS: Final[Mapping[str, Callable[[float], float]]] = {
    "exp": math.exp,
    "log": math.log,
    "floor": math.floor,
    "ceil": math.ceil,
    "round": round,
}
_OF_ANGLES: Final[Mapping[str, Callable[[float], float]]] = {"sin": math.sin, "cos": math.cos, "tan": math.tan}
_TO_ANGLES: Final[Mapping[str, Callable[[float], float]]] = {"asin": math.asin, "acos": math.acos, "atan": math.atan}
FUNCTIONS: Final = ("abs", "sqrt", "min", "max", *_PLAIN_FUNCTIONS, *_OF_ANGLES, *_TO_ANGLES)
_TOKEN: Final = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[^\W\d_]+|°|%)|(?P<sign>\*\*|[-+*/^(),]))"
)
_SAME_SIGNS: Final = str.maketrans(
    {"−": "-", "×": "*", "·": "*", "÷": "/", "µ": "u", "μ": "u", "²": "^2", "³": "^3", "º": "°"}
)
_RELATIVE: Final = re.compile(r"\s*(?:([-+*/])=|([*/]))")


class ExpressionError(ElysError):
    """What was typed is no value for the field; one sentence for beside it."""


@dataclass(frozen=True, slots=True)
class Entry:
    """What was typed, worked out: a value (=), or what is done to the value that each entity has. In the field's unit."""

    operation: Operation
    operand: float

    def applied(self, own: float) -> float:
        """What becomes of an entity's own value."""
        match self.operation:
            case "=":
                return self.operand
            case "+":
                return own + self.operand
            case "-":
                return own - self.operand
            case "*":
                return own * self.operand
            case "/":
                return own / self.operand


class _Quantity(NamedTuple):
    value: float  # in SI
    dimension: Dimension


class _Token(NamedTuple):
    kind: Literal["number", "name", "sign", "end"]
    text: str
    is_joined: bool  # to the one before it, without a blank


def read_entry(text: str, unit: str = "") -> Entry:
    """Works out what was typed into a field of that unit, as a declaration spells it ("m", "rad | m").

    Raises:
        ExpressionError: it is no arithmetic, has no finite value or measures something else.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"a number is typed with at most {MAX_LENGTH} characters, not {len(text)}")
    accepted = units_of(unit)
    relative = _RELATIVE.match(text)
    if relative is None:
        return Entry("=", _worked_out(text, accepted, unit))
    sign: Operation = relative[1] or relative[2]  # type: ignore[assignment]  # the pattern lets no other through
    rest = text[relative.end() :]
    if sign in ("+", "-"):
        return Entry(sign, _worked_out(rest, accepted, unit))
    operand = _worked_out(rest, (), "")
    if sign == "/" and operand == 0.0:
        raise ExpressionError("nothing can be divided by zero")
    return Entry(sign, operand)


def _worked_out(text: str, accepted: tuple[Unit, ...], unit: str) -> float:
    """The value in the field's unit: that one of `accepted` which it measures, or any where it is a plain number."""
    own = accepted[0] if accepted else Unit(PLAIN, 1.0)
    found = _Reading(text, own, binds_units=True).result()
    if found.dimension != PLAIN and all(found.dimension != one.dimension for one in accepted):
        weak = _Reading(text, own, binds_units=False).result()
        if any(weak.dimension == one.dimension for one in accepted):
            found = weak
    if found.dimension == PLAIN:
        return found.value
    for one in accepted:
        if one.dimension == found.dimension:
            return found.value / one.size
    wanted = " or ".join(dict.fromkeys(described(one.dimension) for one in accepted)) or described(PLAIN)
    raise ExpressionError(
        f"'{text.strip()}' is {described(found.dimension)}, and this takes {wanted}{f' [{unit}]' if unit else ''}"
    )


class _Reading:
    """One pass over what was typed; `own` is the unit of numbers that are added to quantities without having one."""

    def __init__(self, text: str, own: Unit, *, binds_units: bool) -> None:
        self._text = text.strip()
        self._own = own
        self._binds_units = binds_units
        self._tokens = _tokens(text)
        self._at = 0
        self._depth = 0

    def result(self) -> _Quantity:
        """The value of all of it."""
        if self._next.kind == "end":
            raise ExpressionError("nothing was typed")
        found = self._sum()
        if self._next.kind != "end":
            self._fail_at_next()
        if not math.isfinite(found.value):
            raise ExpressionError(f"'{self._text}' is too large a number")
        return found

    @property
    def _next(self) -> _Token:
        return self._tokens[self._at]

    def _takes(self, *signs: str) -> str:
        """The sign that comes next, if it is one of these; it is read then."""
        token = self._next
        if token.kind == "sign" and token.text in signs:
            self._at += 1
            return token.text
        return ""

    def _sum(self) -> _Quantity:
        left = self._product()
        while sign := self._takes("+", "-"):
            left, right = self._alike(left, self._product())
            left = _Quantity(left.value + right.value if sign == "+" else left.value - right.value, left.dimension)
        return left

    def _product(self) -> _Quantity:
        left = self._joined()
        while True:
            if sign := self._takes("*", "/"):
                right = self._joined()
            elif self._next.kind == "name" and not self._is_call():
                sign, right = "*", self._joined()
            else:
                return left
            left = self._times(left, right, -1 if sign == "/" else 1)

    def _joined(self) -> _Quantity:
        left = self._power()
        while self._binds_units and self._next.kind == "name" and self._next.text in UNITS and not self._is_call():
            left = self._times(left, self._power(), 1)
        return left

    def _power(self) -> _Quantity:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionError(f"'{self._text}' is nested too deeply")
        if sign := self._takes("+", "-"):
            inner = self._power()
            found = _Quantity(-inner.value if sign == "-" else inner.value, inner.dimension)
        else:
            found = self._atom()
            if self._takes("^", "**"):
                found = self._raised(found, self._power())
        self._depth -= 1
        return found

    def _atom(self) -> _Quantity:
        token = self._next
        if self._is_call():
            return self._call()
        if token.kind == "sign" and self._takes("("):
            found = self._sum()
            self._close()
            return found
        if token.kind == "number":
            self._at += 1
            return _Quantity(float(token.text), PLAIN)
        if token.kind == "name":
            self._at += 1
            if token.text in CONSTANTS:
                return _Quantity(CONSTANTS[token.text], PLAIN)
            if token.text in UNITS:
                return self._with_digits(_Quantity(UNITS[token.text].size, UNITS[token.text].dimension))
            raise ExpressionError(
                f"there is no unit or constant '{token.text}'; {similar_names(token.text, self._own.dimension)}"
            )
        return self._fail_at_next()

    def _with_digits(self, unit: _Quantity) -> _Quantity:
        """m2 is a square metre."""
        token = self._next
        if token.kind == "number" and token.is_joined and token.text.isdigit():
            self._at += 1
            return self._raised(unit, _Quantity(float(token.text), PLAIN))
        return unit

    def _is_call(self) -> bool:
        """Whether a function's name and its parenthesis come next."""
        token = self._next
        return token.kind == "name" and token.text in FUNCTIONS and self._tokens[self._at + 1].text == "("

    def _call(self) -> _Quantity:
        name = self._next.text
        self._at += 2
        given = [self._sum()]
        while self._takes(","):
            given.append(self._sum())
        self._close()
        if name in ("min", "max"):
            best = given[0]
            for other in given[1:]:
                best, other = self._alike(best, other)
                best = min(best, other) if name == "min" else max(best, other)
            return best
        if len(given) != 1:
            raise ExpressionError(f"{name} takes one value, not {len(given)}")
        return self._function(name, given[0])

    def _function(self, name: str, given: _Quantity) -> _Quantity:
        value, dimension = given
        if name == "abs":
            return _Quantity(abs(value), dimension)
        if name == "sqrt":
            return self._raised(given, _Quantity(0.5, PLAIN))
        angle = UNITS["rad"].dimension
        if dimension != PLAIN and not (name in _OF_ANGLES and dimension == angle):
            raise ExpressionError(f"{name} does not take {described(dimension)}")
        compute = _PLAIN_FUNCTIONS.get(name) or _OF_ANGLES.get(name) or _TO_ANGLES[name]
        try:
            # Where the field is no angle, one worked out on the way is its plain radians.
            is_angle = name in _TO_ANGLES and self._own.dimension == angle
            return _Quantity(float(compute(value)), angle if is_angle else PLAIN)
        except (ValueError, OverflowError):
            raise ExpressionError(f"{name} of {value:g} has no value") from None

    def _alike(self, left: _Quantity, right: _Quantity) -> tuple[_Quantity, _Quantity]:
        """Both in the same dimension: a number without a unit beside a quantity of the field's kind is in the field's unit."""
        if left.dimension == right.dimension:
            return left, right
        size, dimension = self._own.size, self._own.dimension
        if left.dimension == PLAIN and right.dimension == dimension:
            return _Quantity(left.value * size, dimension), right
        if right.dimension == PLAIN and left.dimension == dimension:
            return left, _Quantity(right.value * size, dimension)
        raise ExpressionError(f"{described(left.dimension)} and {described(right.dimension)} cannot be put together")

    def _times(self, left: _Quantity, right: _Quantity, power: int) -> _Quantity:
        dimension = tuple(a + power * b for a, b in zip(left.dimension, right.dimension, strict=True))
        if power < 0 and right.value == 0.0:
            raise ExpressionError(f"'{self._text}' divides by zero")
        return _Quantity(left.value * right.value if power > 0 else left.value / right.value, dimension)

    def _raised(self, base: _Quantity, exponent: _Quantity) -> _Quantity:
        if exponent.dimension != PLAIN:
            raise ExpressionError(f"an exponent is a plain number, not {described(exponent.dimension)}")
        try:
            value = math.pow(base.value, exponent.value)
        except OverflowError:
            raise ExpressionError(f"'{self._text}' is too large a number") from None
        except ValueError:
            raise ExpressionError(f"{base.value:g} to the power {exponent.value:g} has no value") from None
        return _Quantity(value, tuple(power * exponent.value for power in base.dimension))

    def _close(self) -> None:
        if not self._takes(")"):
            if self._next.kind == "end":
                raise ExpressionError(f"'{self._text}' lacks a closing parenthesis")
            self._fail_at_next()

    def _fail_at_next(self) -> NoReturn:
        token = self._next
        if token.kind == "end":
            raise ExpressionError(f"'{self._text}' ends too early")
        raise ExpressionError(f"'{token.text}' is not expected where it stands in '{self._text}'")


def _tokens(text: str) -> list[_Token]:
    text = text.translate(_SAME_SIGNS)
    if "(" not in text:  # where nothing separates arguments a comma is a decimal point, as half of the world writes it
        text = re.sub(r"(\d),(\d)", r"\1.\2", text)
    tokens: list[_Token] = []
    at, end = 0, len(text.rstrip())
    while at < end:
        found = _TOKEN.match(text, at)
        if found is None:
            rest = text[at:].strip()
            raise ExpressionError(f"'{rest[0]}' is not expected in '{text.strip()}'")
        kind: Literal["number", "name", "sign"] = found.lastgroup  # type: ignore[assignment]  # the pattern's three groups
        tokens.append(_Token(kind, found[kind], found.start(kind) == at))
        at = found.end()
    return [*tokens, _Token("end", "", False)]
