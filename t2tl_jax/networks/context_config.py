"""The configuration of the context: how much of an episode is remembered, who reads it, and how it is learned.

The readers of context that the project ships are registered here, so that whoever has a configuration has them too.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

from t2tl_jax.networks.gru import GRUConfig, GRUWindowReader
from t2tl_jax.networks.task_encoder import SequenceEncoderConfig
from t2tl_jax.networks.transformer import TransformerConfig, TransformerEncoder
from t2tl_jax.registry import register_context_reader


@dataclass(frozen=True)
class ContextConfig:
    """What the window holds, and who reads it."""

    length: int = 8
    """Steps that the window holds; a carried state has none."""
    reader: SequenceEncoderConfig = field(
        default_factory=lambda: TransformerConfig(layers=1, width=32, feed_forward=128)
    )
    """Who reads the window: a Transformer, by default of the sizes that the published code comes down to (unless it is
    masked, empty slots count as tokens of zeros), a GRU from the oldest step to the newest, or any other that is
    registered."""
    carried: bool = False
    """Carry the reader's state through the whole episode, instead of reading the last steps anew at every step. Needs a
    GRU, which in the update is unrolled over a segment from the state at its start: gradients reach back to there, so
    segments should be longer."""
    reset: bool = True
    """Empty the window at the start of every episode (paper); the published code never does."""
    first_token: Literal["none", "made_up"] = "none"
    """What PPO's windows hold when a training begins: nothing (paper), or one token that no step has made, of an action
    drawn uniformly, reward 0 and the first observation (published code). An empty window is zeros to the published
    reader, whose gradient there can be very large. Evaluations begin with empty windows in either case. Needs
    reset=False."""
    aligned: bool = True
    """Update every sample with its own window; False gives it that of another sample, as the published code does."""
    halved: bool = False
    """Halve the given layers, width and feed_forward but not T-Fixup's factors, as the published code does in silence
    (its flags say 2, 64 and 256)."""
    recompute: bool = True
    """Keep observations, and embed them anew with gradient in the update; False keeps the embedding made when acting
    (published code), through which no gradient flows. States that read the task (merged) are made anew at every step:
    they need True, and go into the tokens by themselves, without the layers of the environment encoder."""
    segment_length: int = 8
    """PPO draws its minibatches in pieces of so many successive steps, which share the work on their windows or their
    carried state; must divide unroll_length. 1 draws every step by itself, as the published code does, and takes
    longer."""

    def __post_init__(self) -> None:
        if self.length < 1:
            raise ValueError(f"a context window holds at least one step, got length={self.length}")
        if self.segment_length < 1:
            raise ValueError(f"a segment holds at least one step, got segment_length={self.segment_length}")
        if not self.aligned and self.segment_length > 1:
            raise ValueError(
                "aligned=False gives every step the window of another one, so steps share nothing; it needs "
                f"segment_length=1, got segment_length={self.segment_length}"
            )
        if self.carried and not isinstance(self.reader, GRUConfig):
            raise ValueError(
                "carried=True needs a reader with a state, network.context.reader=gru, got a reader of "
                f"{type(self.reader).__name__}"
            )
        if self.carried and self.length != ContextConfig.length:
            raise ValueError(
                f"a state that is carried has no window, so that its length={self.length} would mean nothing: leave "
                f"it at {ContextConfig.length}, or use carried=False"
            )
        if self.carried and self.segment_length < 2:
            raise ValueError(
                "a carried state is learned over the steps of a segment, and the first of them reads the state that "
                f"was stored: carried=True needs segment_length=2 or more, got segment_length={self.segment_length}"
            )
        if self.carried and not (self.aligned and self.recompute):
            raise ValueError(
                "with carried=True there are no windows to misalign and no embeddings to keep; it needs aligned=True "
                f"and recompute=True, got aligned={self.aligned} and recompute={self.recompute}"
            )
        if self.first_token != "none" and self.carried:
            raise ValueError(
                f"first_token={self.first_token} is put into a window, and a state that is carried has none; use "
                "first_token=none, or carried=False"
            )
        if self.first_token != "none" and self.reset:
            raise ValueError(
                f"with reset=True every episode begins with an empty window; first_token={self.first_token} needs "
                "reset=False"
            )
        if self.halved and not isinstance(self.reader, TransformerConfig):
            raise ValueError(
                f"halved=True is a mistake in building a Transformer, got a reader of {type(self.reader).__name__}"
            )
        if isinstance(self.reader, TransformerConfig) and self.halved and self.reader.layers < 2:
            raise ValueError(
                f"halved=True needs a context Transformer of two layers or more, got layers={self.reader.layers}"
            )

    @property
    def encoder(self) -> SequenceEncoderConfig:
        """The reader as it is built."""
        if not self.halved:
            return self.reader
        sizes = {name: getattr(self.reader, name) // 2 for name in ("layers", "width", "feed_forward")}
        return replace(self.reader, **sizes)


register_context_reader("transformer", TransformerConfig, TransformerEncoder)
register_context_reader("gru", GRUConfig, GRUWindowReader)
