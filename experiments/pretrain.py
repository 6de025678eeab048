"""Pre-train a task encoder: ``python -m experiments.pretrain --config zone``; otherwise like ``experiments.run``.

``--config NAME`` stands for the configuration ``pretrain_NAME``.
"""

import sys
from collections.abc import Sequence

from experiments import run
from experiments.cli.errors import guarded

PREFIX = "pretrain_"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code, as `experiments.run.main`."""
    texts = sys.argv[1:] if arguments is None else list(arguments)
    return guarded(lambda: run.command(texts, prefix=PREFIX, module="experiments.pretrain"))


if __name__ == "__main__":
    sys.exit(main())
