"""One law, several languages: rebuild a plain Python function so that its free names mean another language's functions.

A law is a function of floats with one `return`, at its end, that uses only arithmetic, comparisons, `sqrt`, `exp`,
`pow`, `min`, `max`, `abs` and other laws. As it stands it is ordinary float64 Python: the test oracle.
"""

import functools
import types
from collections.abc import Callable, Mapping
from typing import Any

import warp as wp

WARP_NAMES = {"sqrt": wp.sqrt, "exp": wp.exp, "pow": wp.pow, "min": wp.min, "max": wp.max, "abs": wp.abs}


def rebound(law: Callable, names: Mapping[str, object]) -> Callable:
    """The same code with other globals; `inspect` still finds its source, by the code."""
    copy = types.FunctionType(law.__code__, {**law.__globals__, **names}, law.__name__, law.__defaults__)
    functools.update_wrapper(copy, law)
    del copy.__wrapped__  # a language that compiles it must not take it for a decorated function
    return copy


@functools.cache
def warp_func(law: Callable, *inner: Callable) -> Any:
    """The law as a Warp function; `inner` are the laws that it calls, in order of their own needs."""
    names = dict(WARP_NAMES)
    for function in inner:
        names[function.__name__] = warp_func(function)
    return wp.func(rebound(law, names))
