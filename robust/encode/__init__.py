"""A plan as formulas: enc_tn, enc_eff and enc_proofs as named obligations, in two encodings [IRR §2]."""

from collections.abc import Mapping
from fractions import Fraction

from robust.backends import ENCODINGS
from robust.encode.interface import EPSILON, Encoding, Range
from robust.errors import InputError, did_you_mean
from robust.plan.model import ParametrizedPlan
from robust.smt.limits import NEVER, Deadline


def create_encoding(
    name: str,
    plan: ParametrizedPlan,
    epsilon: Fraction = EPSILON,
    deadline: Deadline = NEVER,
    *,
    ranges: Mapping[str, Range] | None = None,
) -> Encoding:
    """The encoding of that name.

    Args:
        name: `relational` or `positions`.
        plan: the ground, parametrized plan.
        epsilon: the separation of mutex time points.
        deadline: when queries stop being built.
        ranges: the parameter values that will be asked about; all that are declared if not given.

    Raises:
        InputError: if there is no such encoding.
        UnsupportedError: if an expression is not linear after folding constants.
    """
    match name:
        case "relational":
            from robust.encode.encoding import RelationalEncoding  # noqa: PLC0415 - only the one that is used

            return RelationalEncoding(plan, epsilon, ranges)
        case "positions":
            from robust.encode.positions import PositionsEncoding  # noqa: PLC0415 - likewise

            return PositionsEncoding(plan, epsilon, deadline=deadline)
    raise InputError(f"unknown encoding {name!r}{did_you_mean(name, ENCODINGS)}")
