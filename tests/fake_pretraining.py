"""Makes every automatic pre-training of this process that of the fake learner, for ``--import tests.fake_pretraining``."""

import tests.fake_learner  # noqa: F401

from t2tl_jax.runs import pretraining

pretraining.SCHEDULE = "pretrain_fake"
