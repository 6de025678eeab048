"""What fields and flags of version 0.1 are called now: for stored configurations, and for who still writes them."""

FIELDS = {"simultaneous": "random_starts"}
"""Fields of a configuration."""

LEARNER_FIELDS = {
    "ppo": {"rollout_steps": "unroll_length", "clip": "clip_eps"},
    "dqn": {"steps_per_iteration": "unroll_length", "simultaneous": "counterfactual"},
}
"""Fields of each learner, whose names became the usual ones."""

ENCODERS = ("transformer", "rgcn", "gru")
"""Each had a field of its own beside the choice between them."""


def _flag(*fields: str) -> str:
    return "--" + ".".join(fields).replace("_", "-")


FLAGS = {
    **{_flag(old): _flag(new) for old, new in FIELDS.items()},
    **{
        _flag(learner, old): _flag("learner", new)
        for learner, renamed in LEARNER_FIELDS.items()
        for old, new in renamed.items()
    },
    "--network.one-hot-size": "--learner.network.task-encoder.size",
    "--checkpoint": "--which",
}
"""Flags that are called otherwise."""

BEGINNINGS = {
    "--network.context.transformer.": "--learner.network.context.reader.",
    **{f"--network.{encoder}.": "--learner.network.task-encoder." for encoder in ENCODERS},
    "--network.": "--learner.network.",
    **{f"--{learner}.": "--learner." for learner in LEARNER_FIELDS},
}
"""How other flags began, and begin now; the first one counts."""


def new_flag(flag: str) -> str:
    """What a flag of 0.1 is called now; '' for one that it did not have."""
    if flag in FLAGS:
        return FLAGS[flag]
    return next((new + flag.removeprefix(old) for old, new in BEGINNINGS.items() if flag.startswith(old)), "")
