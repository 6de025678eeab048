"""crm's single task in the published form was trained twice: an earlier training, which was cut, beside the whole."""

from pathlib import Path

from experiments.paper import published_water
from experiments.reproduction.page import made_by, paragraph
from experiments.reproduction.sections.benchmark import greatest_scores, recent
from experiments.reproduction.sections.ten_tasks import FORM
from experiments.reproduction.stored import Stored

CUT = "rm_single_crm_published_cut"
"""Its folder, among those of WaterWorld."""

NAME = f"rm-single-crm{FORM}"

MARK = 1_000_000
"""The last step that the cut run reached and of which both figures are published."""


def published_form(results: Path) -> str:
    """What both came to at the same step."""
    cut, whole = Stored(results / "water_h200" / CUT), Stored(results / "paper" / NAME)
    reached, asked = int(cut.columns["frames"].max()), cut.config.frames
    k = published_water.STEPS.index(MARK)
    scores = [greatest_scores(run)[:, k] for run in (whole, cut)]
    paid = [recent(run, (MARK,), "total_reward")[:, 0] for run in (whole, cut)]
    note = f"""
        An earlier training by the same settings and seeds was lost with its machine after {reached:,} of {asked:,}
        steps on each map, so nothing of it was evaluated. After {MARK:,} steps its greatest possible score was
        {scores[1].mean():.2f}, from {scores[1].min():.2f} to {scores[1].max():.2f} over maps, and
        {paid[1].mean():.3f} of its episodes paid. The whole training had {scores[0].mean():.2f}, from
        {scores[0].min():.2f} to {scores[0].max():.2f}, and {paid[0].mean():.3f}. So much can lie between two trainings
        of the same ten maps."""
    return "\n\n".join((paragraph(note), made_by([cut, whole])))
