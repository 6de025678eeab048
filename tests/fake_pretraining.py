"""``--import tests.fake_pretraining`` makes every automatic pre-training of a process that of the fake learner."""

from t2tl_jax.runs import pretraining
from tests.fake_learner import PRETRAINING

pretraining.SCHEDULE = PRETRAINING
