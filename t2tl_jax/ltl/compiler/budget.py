"""Bounds on what compiling one table may cost, so that no formula can hang the program; each can be raised."""

import re
from dataclasses import dataclass, field

from t2tl_jax import checks
from t2tl_jax.ltl.errors import LTLError, TooLargeError

WORK_PER_ROW = 7_500
"""Units of work that a table may take for each row that it may have, a unit being some 0.2 microseconds of Python."""

WORK_PER_TASK = 500_000
"""What each task adds, so that a table of many small tasks is not refused for its number."""

DEEPEST = 500
"""Most propositions at all: diagrams are as deep as this, and read by functions that call themselves."""


@dataclass(frozen=True)
class Limits:
    """How large a table may become. Raising them costs time and memory, and changes no table that compiled before."""

    max_rows: int = 4096
    """Rows of the table."""
    max_cells: int = 2**26
    """Entries of the arrays in which letters are looked up, and of that of the tokens; 2^26 are 256 MiB."""
    max_tokens: int = 10_000
    """Tokens of one row."""
    max_terms: int = 2_000
    """Disjuncts of one progressed formula in disjunctive normal form."""
    max_work: int = 0
    """Units of work, some 0.2 microseconds each; 0 for 7,500 for every row of max_rows and 500,000 for every task."""
    max_propositions: int = 200
    """Propositions that the tasks may use, at most 500; of the alphabet "every_subset" never more than 31."""

    def __post_init__(self) -> None:
        try:
            checks.whole(self, *vars(self))
        except ValueError as error:
            raise LTLError(str(error)) from None
        for name, value in vars(self).items():
            if value < (name != "max_work"):
                raise LTLError(f"{name} must be at least {int(name != 'max_work')}, got {value}")
        if self.max_propositions > DEEPEST:
            raise LTLError(f"max_propositions must be at most {DEEPEST}, got {self.max_propositions}")

    def work(self, tasks: int) -> int:
        """Units of work that a table of so many tasks may take."""
        return self.max_work or WORK_PER_ROW * self.max_rows + WORK_PER_TASK * tasks


def way_out(limit: str, least: int) -> str:
    """How to raise a limit: in Python, and as a flag."""
    flag = f"--limits.{limit.replace('_', '-')}"
    return f"raise it to {least:,} or more ({limit} of Limits; of a run {flag} {least})"


def way_out_alone(message: str) -> str:
    """The message of a limit for `python -m t2tl_jax.ltl`, whose flag is `--max-rows`, and which pads no table."""
    message = re.sub(r"pad to fewer tokens \(of a run [^)]*\), or ", "", message)
    return re.sub(r"\((?:max_\w+ of Limits; )?of a run --limits\.([\w-]+ \d+)\)", r"(--\1)", message)


@dataclass
class Budget:
    """What one compilation may still spend."""

    limits: Limits = field(default_factory=Limits)
    tasks: int = 1
    spent: int = 0

    def __post_init__(self) -> None:
        self.max_terms, self._most = self.limits.max_terms, self.limits.work(self.tasks)

    def spend(self, amount: int) -> None:
        """Count `amount` units of work: 1 for a pair of terms, some 20 for a diagram node."""
        self.spent += amount
        if self.spent > self._most:
            raise TooLargeError(
                f"compiling took more than {self._most:,} steps of work, the limit max_work; the tasks are too "
                "entangled: split the formula, use fewer of them in one table, or "
                f"{way_out('max_work', 4 * self._most)}"
            )

    def check_terms(self, count: int) -> None:
        """Refuse a progressed formula with too many disjuncts."""
        if count > self.max_terms:
            raise TooLargeError(
                f"a progressed formula reached {count:,} disjuncts; the limit is max_terms={self.max_terms:,}: "
                f"{way_out('max_terms', count)}"
            )

    def check_states(self, count: int) -> None:
        """Refuse too many progressed formulas before merging; minimisation rarely merges more than eight into one."""
        most = self.limits.max_rows
        if count > 8 * most:
            raise TooLargeError(
                f"progression reached {count:,} distinct formulas and is not finished; the limit is "
                f"8 * max_rows = {8 * most:,}: simplify the task, or raise max_rows; what it takes is not known yet, "
                f"and {16 * most:,} goes 16 times as far (of a run --limits.max-rows {16 * most})"
            )

    def check_tokens(self, count: int) -> None:
        """Refuse a row whose shortest known formula is unreasonably long."""
        if count > self.limits.max_tokens:
            raise TooLargeError(
                f"a progressed formula has {count:,} tokens; the limit is max_tokens={self.limits.max_tokens:,}: "
                f"{way_out('max_tokens', count)}"
            )

    def check_rows(self, count: int) -> None:
        """Refuse too many rows after merging."""
        if count > self.limits.max_rows:
            raise TooLargeError(
                f"the table needs {count:,} rows; the limit is max_rows={self.limits.max_rows:,}: "
                f"{way_out('max_rows', count)}"
            )
