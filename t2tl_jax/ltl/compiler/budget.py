"""Bounds on what compiling one set of tasks may cost, so that no formula can hang the program."""

from dataclasses import dataclass

from t2tl_jax.ltl.errors import TooLargeError

MAX_ROWS = 4096
"""Default bound on the rows of a table."""

MAX_TERMS = 2_000
"""Most disjuncts of one progressed formula in disjunctive normal form."""

MAX_WORK = 30_000_000
"""Most units of work in one compilation, a unit being some 0.2 microseconds of Python: several seconds."""

MORE_WORK_PER_TASK = 500_000
"""What each further task adds to `MAX_WORK`, so that a table of many small tasks is not refused for its number."""

MAX_TOKENS = 10_000
"""Most tokens of one row."""

MAX_CELLS = 2**26
"""Most entries (rows x letters) of the transition table: 256 MiB of int32."""

MAX_PROPOSITIONS = 200
"""Most propositions that the formulas of one table may use (diagrams are as deep as this)."""


@dataclass
class Budget:
    """What one compilation may still spend."""

    max_rows: int = MAX_ROWS
    max_work: int = MAX_WORK
    max_terms: int = MAX_TERMS
    work: int = 0

    def spend(self, amount: int) -> None:
        """Count `amount` units of work: 1 for a pair of terms, some 20 for a diagram node."""
        self.work += amount
        if self.work > self.max_work:
            raise TooLargeError(
                f"compiling took more than {self.max_work:,} steps of work (budget.MAX_WORK); "
                "the tasks are too entangled: split the formula, or use fewer of them in one table"
            )

    def check_terms(self, count: int) -> None:
        """Refuse a progressed formula with too many disjuncts."""
        if count > self.max_terms:
            raise TooLargeError(
                f"a progressed formula reached {count:,} disjuncts; the limit is {self.max_terms:,} (budget.MAX_TERMS)"
            )

    def check_states(self, count: int) -> None:
        """Refuse too many progressed formulas before merging; minimisation rarely merges more than eight into one."""
        if count > 8 * self.max_rows:
            raise TooLargeError(
                f"progression reached {count:,} distinct formulas and is not finished; "
                f"the limit is 8 * max_rows = {8 * self.max_rows:,}: raise max_rows, or simplify the task"
            )

    def check_tokens(self, count: int) -> None:
        """Refuse a row whose shortest known formula is unreasonably long."""
        if count > MAX_TOKENS:
            raise TooLargeError(
                f"a progressed formula has {count:,} tokens; the limit is {MAX_TOKENS:,} (budget.MAX_TOKENS)"
            )

    def check_rows(self, count: int) -> None:
        """Refuse too many rows after merging."""
        if count > self.max_rows:
            raise TooLargeError(f"the table needs {count:,} rows; the limit is max_rows={self.max_rows:,}: raise it")
