"""The moving picture of the documentation: an episode of an agent whose parameters are stored."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from experiments.reproduction.pictures import drawn
from t2tl_jax.evaluation.animation import captions, save_gif
from t2tl_jax.runs import train
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.prompt import Prompt


@dataclass(frozen=True)
class EpisodeGIF:
    """A GIF of `docs`: one episode of the deterministic policy, with what is left to do below it."""

    file: str
    """Its name there."""
    run: Path
    """Folder of the stored run, with parameters."""
    formula: str

    def digest(self) -> str:
        """Of what the agent and its task are: the parameters as they are stored, and the formula."""
        params = RunFolder(self.run).params.read_bytes()
        return hashlib.sha256(params + self.formula.encode()).hexdigest()

    def draw(self, target: Path) -> None:
        """Write the GIF, unless it is there: playing takes a minute, and ends otherwise on another machine."""
        if target.is_file() and drawn(target) == self.digest():
            return
        result = train.load(self.run)
        view = result.experiment.env.view()
        assert view is not None
        played = Prompt(result).play(self.formula)
        texts = [played.table.text(row) for row in range(int(played.recording.rows.max()) + 1)]
        save_gif(played.recording, view, target, captions(texts), self.digest())
