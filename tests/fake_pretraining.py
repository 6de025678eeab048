"""``--import tests.fake_pretraining`` makes every automatic pre-training of a process that of the fake learner."""

import tests.fake_learner  # noqa: F401
from t2tl_jax.runs import pretraining

pretraining.SCHEDULE = "pretrain_fake"
