"""The parts of an iteration of training, by the named scopes of the code that does them."""

import re

WORD = re.compile(r"[A-Za-z0-9_.<>]+")

REST = "the rest"
"""What stands in no scope that is known: sums of episodes, random keys, copies."""

PARTS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("clipping and Adam", ("optimiser",)),
    ("codes of tasks", ("codes",)),
    ("codes of tasks", ("task_encoder",)),
    ("learning: context", ("loss", "context_encoder")),
    ("learning: state and heads", ("loss",)),
    ("drawing minibatches", ("minibatches",)),
    ("replay", ("replay",)),
    ("copying the target network", ("target",)),
    ("values: context", ("advantage", "context_encoder")),
    ("values: state and head", ("advantage",)),
    ("acting: context", ("policy", "context_encoder")),
    ("acting: state and head", ("policy",)),
    ("physics", ("environment", "physics")),
    ("observation, labels, progression", ("environment",)),
    ("resets", ("reset",)),
    ("freezing seeds", ("guard",)),
)
"""Names of parts, and the scopes that have to be in a path for it to belong there; the first that fits counts."""

NAMES = (*dict.fromkeys(name for name, _ in PARTS), REST)
"""Every part, in the order of the tables."""


def part_of(path: str) -> str:
    """The part that a path of scopes belongs to, such as `jit(iterate)/vmap(policy)/ActorCritic.policy/actor`.

    Transformations are seen through: `transpose(jvp(loss))` is in the scope `loss`. Methods of a module, such as
    `context_encoder.segment`, are in its scope.
    """
    scopes = set()
    for word in WORD.findall(path):
        scopes |= {word, word.split(".")[0]}
    return next((name for name, needed in PARTS if scopes.issuperset(needed)), REST)
