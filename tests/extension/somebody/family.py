"""A family of random tasks: two lamps one after the other, or together."""

from t2tl_jax import parse, register_family


def draw(rng, propositions):
    first, second = rng.sample(propositions, 2)
    return parse(f"F({first} & {rng.choice(['F', ''])} {second})")


register_family("Lights", draw, least=2)
