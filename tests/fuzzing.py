"""Nonsense for fuzz tests, and what is asked of a command that is given some.

The examples are the same every time. More of them: set EXAMPLES to a factor, as in
``EXAMPLES=20 python -m pytest tests/experiments/test_fuzz.py tests/experiments/test_fuzz_folders.py``.
"""

import contextlib
import io
import json
import os
import time

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

FACTOR = float(os.environ.get("EXAMPLES", "1"))
SOON = 30.0
"""Seconds that one example may take; most take hundredths."""


def examples(count):
    kept = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large]
    return settings(max_examples=round(count * FACTOR), suppress_health_check=kept)


def said(command, *texts):
    """Exit code and what was printed to standard error, where a traceback would show."""
    errors, begin = io.StringIO(), time.monotonic()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        code = command(list(texts))
    assert time.monotonic() - begin < SOON, texts
    return code, errors.getvalue()


def is_polite(code, errors):
    """Done, or refused in words."""
    return code == 0 or (code == 2 and errors.strip() and "Traceback" not in errors)


NONSENSE = st.sampled_from(
    [None, True, -1, 0, 1e308, float("nan"), float("inf"), 2 * 10**9, 2**63, "", "x", "../..", "/a.rm", [], {}, [[]]]
)


@st.composite
def changed(draw, content):
    """JSON with a few values replaced, lost or added somewhere."""
    content = json.loads(json.dumps(content))
    for _ in range(draw(st.integers(1, 3))):
        at = content
        while isinstance(at, dict) and at:
            key = draw(st.sampled_from(sorted(at)))
            if not isinstance(at[key], dict) or not at[key] or draw(st.integers(0, 3)) == 0:
                kind = draw(st.sampled_from(["replace", "replace", "lose", "add"]))
                if kind == "lose":
                    del at[key]
                else:
                    at[key if kind == "replace" else key + "_"] = draw(NONSENSE)
                break
            at = at[key]
    return content
