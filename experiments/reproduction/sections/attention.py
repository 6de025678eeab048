"""The attention figure over seeds: what each token receives, what the policy needs, and whether these are one."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.benchmarks.removal import table as removal_table
from experiments.paper import published_attention
from experiments.reproduction.cells import cost_line, share, solved, text
from experiments.reproduction.claims import Share, majorities
from experiments.reproduction.page import origin, paragraph, table
from experiments.reproduction.stored import Stored
from experiments.reproduction.work import READING
from t2tl_jax.evaluation.statistics import Estimate, score_interval
from t2tl_jax.runs.folder import read_json

RUNS = ("prime-fresh", "prime-own")

TITLES = {"prime-fresh": "from a fresh encoder", "prime-own": "from a pre-trained encoder"}

STAGES = ("start", "end")

GOAL = "Black"
"""What has to be entered first."""

NOTE = """Token* is the token that receives most attention, the needed token the one without which the policy moves
most. The paper shows one agent, so each of its claims is asked of every seed here, and is reproduced where it holds for
more than half of the seeds (of the episodes, for what is entered first). By chance token* would be a given one of nine
tokens in one seed of nine. At the start the published conjunction leads by less than what reading the picture errs."""

OF_ALL = f"""Figures of the end are of all seeds, also of agents that do not do the task: the share of episodes that
carry it out is {{success}}. So the claims of the end are not of agents alone that do it. Whoever carries the task out
has to enter {GOAL}, but may enter Yellow or White before. What episodes that fail enter first is not stored; if they
never begin with {GOAL}, the share that enters {GOAL} first cannot be above the share that carries the task out."""

REMOVAL = "removal.json"
"""Of `experiments.benchmarks.removal`, among the results."""

REMOVED = """**A graph network, read without attention.** The paper reads its Transformer by attention, which an R-GCN
does not have. Taking tokens away reads either: `{command}`. These are agents of `{task}`, not of the task above, and
{seeds}, so that nothing is said of other seeds. For each sub-task {episodes} episodes are played, and one step in it is
used of each. A line says without which token, by its position, the policy moves most; at which share of the steps, with
an interval over episodes; and by how much on average, as KL divergence in nats. In the graph network a token takes
along all that hangs on it, so that operators weigh more there. Nothing hangs on propositions, and of these alone the
last columns are."""


def attention(runs: Mapping[str, Stored]) -> str:
    """Token* and the needed token, attention by token beside the published, claims, and how far projections moved."""
    read = {name: read_json(run.path / READING) for name, run in runs.items()}
    stages = {
        (name, stage): found["over_seeds"][stage]
        for name, found in read.items()
        for stage in STAGES
        if stage in found["over_seeds"]
    }
    parts = (
        _table(stages, runs),
        of_all(stages, runs),
        _by_token(stages),
        majorities(claims(stages)),
        _projections(read),
        NOTE if stages else "",
        cost_line(runs),
        removed(runs),
    )
    return "\n\n".join(part for part in parts if part)


def removed(runs: Mapping[str, Stored]) -> str:
    """What stored agents cannot do without, the graph network among them; '' if that is not beside the runs' folder."""
    file = next(iter(runs.values())).path.parents[1] / REMOVAL if runs else None
    if file is None or not file.is_file():
        return ""
    stored = read_json(file)
    agents = stored["agents"]
    text = REMOVED.format(
        command=shlex.join(stored["where"]["command"]),
        task=", ".join(dict.fromkeys(agent["task"] for agent in agents)),
        seeds=", ".join(f"of {Path(agent['run']).name} seed {agent['seed']} alone" for agent in agents),
        episodes=stored["episodes"],
    )
    return "\n\n".join((paragraph(text), removal_table(stored), origin([stored["where"]])))


Stages = Mapping[tuple[str, str], Mapping[str, Any]]
"""What was read, by run and stage."""


def claims(stages: Stages) -> dict[str, Share | None]:
    """What the paper says of its agent, as shares of the seeds of both runs; None where it was not read."""
    found: dict[str, Share | None] = {}
    for name in RUNS:
        start, end = (stages.get((name, stage)) for stage in STAGES)
        found[f"{name}: token* is the conjunction at the start"] = _counted_share(start, "token_star", "and")
        found[f"{name}: token* is {GOAL} at the end"] = _counted_share(end, "token_star", GOAL)
        found[f"{name}: token* is the needed token at the end"] = _share(end and end["agreement"])
        found[f"{name}: {GOAL} is entered first at the end"] = _share(end and end["first"].get(GOAL))
    return found


def _share(estimate: Mapping[str, Any] | None) -> Share | None:
    known = estimate is not None and estimate["value"] is not None
    return (estimate["value"], estimate["count"]) if known and estimate is not None else None


def _counted_share(found: Mapping[str, Any] | None, which: str, token: str) -> Share | None:
    """Of the seeds that have such a token, the share in which it says this."""
    counts = {} if found is None else found[which]
    total = sum(counts.values())
    return (sum(count for name, count in counts.items() if _word(name) == token) / total, total) if total else None


def of_all(stages: Stages, runs: Mapping[str, Stored]) -> str:
    """That agents which do not do the task are among those that were read, and how many episodes carry it out.

    '' where that was not evaluated.
    """
    rates = {name: list(runs[name].by_seed("success_rate").values()) for name, stage in stages if stage == "end"}
    known = [f"{float(np.mean(of)):.2f} ({name})" for name, of in rates.items() if of]
    return paragraph(OF_ALL.format(success=" and ".join(known))) if known else ""


def _of_shares(found: Mapping[str, Any]) -> str:
    """The mean of shares, one for each seed, with the interval that `mean_rate` gives; older files have another."""
    value, count = found["value"], found["count"]
    return (score_interval(value, count) if value is not None and count > 1 else Estimate(**found)).text(2)


def _done(run: Stored, stage: str) -> tuple[str, str]:
    """How many seeds solve the task and how many episodes carry it out: of the final parameters, so at the end."""
    rates = run.by_seed("success_rate")
    return (solved(run), share(rates)) if stage == "end" and rates else ("-", "-")


def _table(stages: Stages, runs: Mapping[str, Stored]) -> str:
    rows: list[tuple[str, ...]] = [
        (
            f"{name}, {stage}",
            _counted(found["token_star"]),
            _counted(found["needed_token"]),
            Estimate(**found["agreement"]).text(2),
            _of_shares(found["agreement_over_rows"]),
            Estimate(**found["rank_correlation"]).text(2),
            _of_shares(found["first"][GOAL]) if GOAL in found["first"] else "-",
            *_done(runs[name], stage),
        )
        for (name, stage), found in stages.items()
    ]
    heading = (
        "run",
        "token*, seeds",
        "needed token, seeds",
        "agree, whole task",
        "agree, all sub-tasks",
        "rank correlation",
        f"episodes that enter {GOAL} first",
        "solved",
        "episodes that carry the task out",
    )
    if not rows:
        return ""
    lead = max(published_attention.START), max(published_attention.END)
    stars = (
        published_attention.TOKENS[published_attention.START.index(lead[0])],
        published_attention.TOKENS[published_attention.END.index(lead[1])],
    )
    blank = ("-",) * (len(heading) - 2)
    rows += [
        (f"published, {stage}", f"{star} ({most:.2f})", *blank)
        for stage, star, most in zip(STAGES, stars, lead, strict=True)
    ]
    return table(heading, rows)


def _by_token(stages: Stages) -> str:
    """What each token of the whole formula receives, summed over heads, beside the published."""
    shown = {
        key: found["attention_received"]
        for key, found in stages.items()
        if found["attention_received"] and tuple(found["tokens"]) == published_attention.TOKENS
    }
    if not shown:
        return ""
    published = (published_attention.START, published_attention.END)
    rows = [
        (
            f"{position}: {token}",
            *(Estimate(**of[position]).text(2) for of in shown.values()),
            *(f"{values[position]:.2f}" for values in published),
        )
        for position, token in enumerate(published_attention.TOKENS)
    ]
    heading = [
        "attention received",
        *(f"{name}, {stage}" for name, stage in shown),
        *(f"published, {stage}" for stage in STAGES),
    ]
    return table(heading, rows)


def _projections(read: Mapping[str, Mapping[str, Any]]) -> str:
    """How far the out-projections of each layer moved in training, over their size at the start."""
    moved = {name: found["out_projection_change"]["by_layer"] for name, found in read.items() if _has_change(found)}
    layers = max((len(of) for by_seed in moved.values() for of in by_seed), default=0)
    rows = [(name, *(text(layer) for layer in _by_layer(by_seed, layers))) for name, by_seed in moved.items()]
    return table(("change of the out-projections", *(f"layer {layer}" for layer in range(layers))), rows)


def moved(run: Stored) -> np.ndarray | None:
    """How far the out-projections of each layer moved: float[seeds, layers]; None where that was not read."""
    found = read_json(run.path / READING)
    return np.array(found["out_projection_change"]["by_layer"]) if _has_change(found) else None


def _has_change(found: Mapping[str, Any]) -> bool:
    return bool(found.get("out_projection_change", {}).get("by_layer"))


def _by_layer(by_seed: Sequence[Sequence[float]], layers: int) -> list[list[float]]:
    return [[of[layer] for of in by_seed if layer < len(of)] for layer in range(layers)]


def _counted(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{_word(token)} {count}" for token, count in counts.items()) or "-"


def _word(token: str) -> str:
    """The token without its position in the formula."""
    return token.partition(": ")[2]
